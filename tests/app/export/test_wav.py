from __future__ import annotations

import io
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
import soundfile

from app.export.wav import (
    LONGEST_TAG_BYTES,
    NORMALISED_PEAK,
    WavSettings,
    WrittenSound,
    faded_out,
    quantised,
    write_wav,
)
from app.shared.vocabulary import Bits

RATE_HZ = 8000
PLAIN = WavSettings(bits="32f", fade_out_s=0)


def sine(frequency_hz: float, seconds: float = 0.5, peak: float = 0.5, rate_hz: int = RATE_HZ) -> np.ndarray:
    return peak * np.sin(2 * np.pi * frequency_hz * np.arange(round(seconds * rate_hz)) / rate_hz)


@dataclass(frozen=True)
class Written:
    """A WAV file in memory."""

    data: bytes
    level: WrittenSound


def written(
    samples: np.ndarray, settings: WavSettings, tags: dict[str, str] | None = None, beside: Sequence[np.ndarray] = ()
) -> Written:
    file = io.BytesIO()
    level = write_wav(file, samples, RATE_HZ, settings, tags or {}, beside)
    return Written(file.getvalue(), level)


def read(wav: Written) -> tuple[np.ndarray, int, str]:
    with soundfile.SoundFile(io.BytesIO(wav.data)) as file:
        return file.read(dtype="float64"), file.samplerate, file.subtype


@pytest.mark.parametrize(
    ("bits", "subtype", "tolerance"),
    [("16", "PCM_16", 1.5 / 2**15), ("24", "PCM_24", 0.5 / 2**23), ("32f", "FLOAT", 1e-7)],
)
def test_every_format_holds_the_samples_to_its_own_step(bits: Bits, subtype: str, tolerance: float) -> None:
    samples = sine(440)
    found, rate_hz, kind = read(written(samples, WavSettings(bits, fade_out_s=0)))
    assert (kind, rate_hz, found.shape) == (subtype, RATE_HZ, samples.shape)
    assert np.abs(found - samples).max() <= tolerance * (1 + 1e-9)


@pytest.mark.parametrize("bits", ["16", "24", "32f"])
def test_the_same_sound_makes_the_same_bytes(bits: Bits, monkeypatch: pytest.MonkeyPatch) -> None:
    first = written(sine(440), WavSettings(bits), {"title": "a"})
    monkeypatch.setattr("time.time", lambda: 0.0)
    assert written(sine(440), WavSettings(bits), {"title": "a"}).data == first.data
    peak = first.data.find(b"PEAK")
    assert (peak > 0) == (bits == "32f")
    assert bits != "32f" or first.data[peak + 12 : peak + 16] == bytes(4)


def test_dither_at_16_bits_is_two_steps_wide_without_offset_and_absent_elsewhere() -> None:
    silence = np.zeros(200_000)
    steps = quantised(silence, "16")[0].astype(np.int64) >> 16
    assert set(np.unique(steps)) <= {-1, 0, 1}
    assert abs(steps.mean()) < 0.01
    assert steps.var() == pytest.approx(0.25, rel=0.05)  # triangular: 1/6 of the draw, 1/12 of the rounding
    assert not quantised(silence, "24")[0].any()


def test_samples_are_rounded_not_floored() -> None:
    step = 2.0**-23
    stored, _ = quantised(np.array([0.4, 0.6, -0.4, -0.6]) * step, "24")
    assert (stored >> 8).tolist() == [0, 1, 0, -1]


def test_what_is_beyond_full_scale_is_clipped_and_counted() -> None:
    samples = np.array([0.0, 1.5, -1.5, -1.0, 0.5])
    wav = written(samples, WavSettings("24", fade_out_s=0))
    found, _, _ = read(wav)
    assert wav.level.clipped == 2
    assert wav.level.peak_db == pytest.approx(20 * math.log10(1.5))
    assert found.tolist() == pytest.approx([0, 1 - 2**-23, -1, -1, 0.5])
    floating = written(samples, PLAIN)
    assert (floating.level.clipped, read(floating)[0].tolist()) == (0, samples.tolist())
    silent = written(np.zeros(100), WavSettings("24", normalise=True)).level
    assert (silent.peak_db, silent.gain_db) == (-math.inf, 0)  # silence is not amplified


def test_the_end_fades_to_zero_and_the_rest_is_untouched() -> None:
    faded = faded_out(np.ones(1000), 80)
    assert (faded[:920] == 1).all()
    assert (np.diff(faded[919:]) < 0).all()
    assert faded[-1] == pytest.approx(0, abs=1e-12)
    assert faded_out(np.ones(3), 80)[-1] == pytest.approx(0, abs=1e-12)  # a fade that is longer than the sound


def test_normalising_takes_one_gain_for_all_channels_and_companions() -> None:
    settings = WavSettings("32f", normalise=True, fade_out_s=0)
    stereo = np.stack([sine(440, peak=0.2), sine(440, peak=0.1)], axis=1)
    found, _, _ = read(written(stereo, settings))
    assert np.abs(found).max(axis=0) == pytest.approx([NORMALISED_PEAK, NORMALISED_PEAK / 2], rel=1e-6)
    alone, _, _ = read(written(stereo[:, 1], settings, beside=[stereo[:, 0]]))
    assert np.abs(alone).max() == pytest.approx(NORMALISED_PEAK / 2, rel=1e-6)


def test_tags_survive_up_to_the_longest() -> None:
    comment = json.dumps({"long": "x" * (LONGEST_TAG_BYTES - 12)})
    assert len(comment) == LONGEST_TAG_BYTES
    for bits in ("16", "32f"):
        wav = written(sine(440), WavSettings(bits), {"title": "Saite № 1", "comment": comment})
        with soundfile.SoundFile(io.BytesIO(wav.data)) as file:
            assert (file.title, file.comment) == ("Saite № 1", comment)


@pytest.mark.parametrize(
    ("samples", "tags", "message"),
    [
        (np.zeros(0), {}, "no samples"),
        (np.array([0.0, np.nan]), {}, "not finite"),
        (np.zeros(5), {"comment": "x" * 2001}, "comment is longer than 2000 bytes"),
    ],
)
def test_what_cannot_be_stored_is_refused(samples: np.ndarray, tags: dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        written(samples, PLAIN, tags)


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"bits": "8"}, "16, 24, 32f"), ({"rate_hz": 999}, "1000 … 384000"), ({"fade_out_s": -1}, "negative")],
)
def test_settings_out_of_range_are_refused(settings: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        WavSettings(**settings)
