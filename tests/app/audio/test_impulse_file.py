"""Impulse responses from files: what is read, and the errors for the rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import soundfile

from app.audio.impulse_file import ImpulseError, cut_words, read_impulse
from engine import bounds

SAMPLES = 0.5 * np.random.default_rng(0).uniform(-1, 1, (3000, 2)) * np.geomspace(1, 1e-3, 3000)[:, None]


@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize(
    ("ending", "subtype"), [("wav", "FLOAT"), ("wav", "PCM_24"), ("flac", "PCM_24"), ("aiff", "PCM_24")]
)
def test_it_is_read_as_it_was_written(tmp_path: Path, ending: str, subtype: str, channels: int) -> None:
    path = tmp_path / f"body.{ending}"
    soundfile.write(path, SAMPLES[:, :channels], 44_100, subtype)
    found = read_impulse(path)
    assert found.rate_hz == 44_100
    np.testing.assert_allclose(found.samples, SAMPLES[:, :channels], atol=2e-7)


def written(path: Path, samples: np.ndarray, rate_hz: int = 48_000, subtype: str = "FLOAT") -> Path:
    soundfile.write(path, samples, rate_hz, subtype)
    return path


def broken(name: str, folder: Path) -> Path:
    path, wild = folder / f"{name}.wav", SAMPLES.copy()
    wild[100, 0] = np.nan
    match name:
        case "missing":
            return path
        case "folder":
            path.mkdir()
            return path
        case "text":
            path.write_text("no sound at all")
            return path
        case "ogg":
            return written(folder / "body.ogg", SAMPLES, subtype="VORBIS")
        case "long":
            return written(path, np.tile(SAMPLES, (500, 1)))  # 31.25 s
        case "channels":
            return written(path, SAMPLES[:, :1].repeat(3, 1))
        case "rate":
            return written(path, SAMPLES, 4_000)
        case "silent":
            return written(path, 0 * SAMPLES)
        case "empty":
            return written(path, SAMPLES[:0])
        case "nan":
            return written(path, wild)
        case _:
            with path.open("wb") as file:
                file.truncate(bounds.LARGEST_IMPULSE_BYTES + 1)
            return path


@pytest.mark.parametrize(
    ("name", "reported"),
    [
        ("missing", "no file"),
        ("folder", "no file"),
        ("text", "no sound file"),
        ("ogg", "save it as WAV"),
        ("long", r"its length must lie in 0 … 30 s, not 31\.25\).*of up to 30 s"),
        ("channels", "its channels"),
        ("rate", "its rate"),
        ("silent", "silent"),
        ("empty", "silent"),
        ("nan", "no numbers"),
        ("huge", "64 MiB"),
    ],
)
def test_what_cannot_be_used_is_reported_with_its_name(tmp_path: Path, name: str, reported: str) -> None:
    path = broken(name, tmp_path)
    with pytest.raises(ImpulseError, match=reported) as error:
        read_impulse(path)
    assert str(error.value).startswith(f"{path}: ") and str(error.value).isprintable()


@pytest.mark.parametrize("seconds", [3.0, 3.0 + 1 / 48_000, 6.97])
def test_of_a_long_response_the_beginning_is_used_and_fades_out(tmp_path: Path, seconds: float) -> None:
    frames, most = round(48_000 * seconds), 3 * 48_000
    samples = np.random.default_rng(0).uniform(-0.5, 0.5, (frames, 2))
    path = written(tmp_path / "hall.wav", samples)
    found, words = read_impulse(path), cut_words(path)
    assert len(found.samples) == most
    whole = most if frames == most else round(2.7 * 48_000)
    np.testing.assert_allclose(found.samples[:whole], samples[:whole], atol=1e-7)
    if frames == most:
        assert words == ""
        return
    assert np.abs(found.samples[-100:]).max() < 1e-4, "no click at its end"
    assert words == f"hall.wav lasts {seconds:.2f} s: its first 3 s, faded out, are the body."
