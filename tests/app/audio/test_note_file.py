"""Recordings of every format are read, and what cannot be used is named with its remedy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import soundfile

from app.audio.note_file import NoteFileError, read_note


@pytest.mark.parametrize("subtype", ["PCM_U8", "PCM_16", "PCM_24", "PCM_32", "FLOAT", "DOUBLE"])
@pytest.mark.parametrize("rate_hz", [44_100, 192_000])
def test_formats(tmp_path: Path, subtype: str, rate_hz: int) -> None:
    sound = 0.5 * np.sin(np.arange(4_000) / 20)
    soundfile.write(tmp_path / "a.wav", np.stack([sound, sound], 1), rate_hz, subtype=subtype)
    read = read_note(tmp_path / "a.wav")
    assert (read.rate_hz, read.samples.shape) == (rate_hz, (4_000, 2))
    assert np.allclose(read.samples[:, 0], sound, atol=0.01)
    assert len(read.digest) == 64


def test_ten_minutes_are_too_long(tmp_path: Path) -> None:
    soundfile.write(tmp_path / "a.wav", np.zeros(600 * 8_000), 8_000, subtype="PCM_U8")
    with pytest.raises(NoteFileError, match=r"lasts 600 s; cut out one note"):
        read_note(tmp_path / "a.wav")


@pytest.mark.parametrize(("content", "words"), [(b"", "no sound file"), (b"no sound at all", "no sound file")])
def test_other_files_are_named(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "a.wav"
    path.write_bytes(content)
    with pytest.raises(NoteFileError, match=words):
        read_note(path)
    with pytest.raises(NoteFileError, match="no file"):
        read_note(tmp_path / "missing.wav")


@pytest.mark.parametrize("form", ["WAV", "AIFF"])
def test_samples_far_beyond_full_scale_are_refused_before_the_fit(tmp_path: Path, form: str) -> None:
    """As of whole numbers of 32 bits in a file of floating point. The fit overflowed, without the file's name."""
    path, sound = tmp_path / "a.wav", np.sin(np.arange(8_000) / 20)
    soundfile.write(path, 32_767 * sound, 8_000, subtype="FLOAT", format=form)
    assert np.abs(read_note(path).samples).max() == pytest.approx(32_767, rel=1e-3)
    soundfile.write(path, 2.0**31 * sound, 8_000, subtype="FLOAT", format=form)
    with pytest.raises(
        NoteFileError, match=r"a\.wav: its largest sample is 2.15e\+09 times full scale; normalise it"
    ):
        read_note(path)


def test_a_folder_is_not_called_missing(tmp_path: Path) -> None:
    with pytest.raises(NoteFileError, match="a folder or a device, no file"):
        read_note(tmp_path)


def test_many_channels_at_a_high_rate_are_refused_before_they_fill_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A minute of silence of eight channels at 384 kHz is a small FLAC, and 1.5 GB of samples."""
    with soundfile.SoundFile(tmp_path / "a.flac", "w", 384_000, 8, "PCM_16") as file:
        for _ in range(6):
            file.write(np.zeros((384_000 * 3, 8), np.int16))
    monkeypatch.setattr(soundfile.SoundFile, "read", lambda *_, **__: pytest.fail("it was read"))
    with pytest.raises(NoteFileError, match="has 8 channels of 384000 Hz for 18 s, which is too much; export one or"):
        read_note(tmp_path / "a.flac")
