"""Sounds become files of the same bytes in blocks of any size, of which memory holds one."""

import io
import math
import tracemalloc
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import soundfile

from app.export import recording
from app.export.wav import NORMALISED_PEAK, WavSettings, faded_out, quantised, write_wav
from app.rendering.note_sound import NoteSound
from engine.pluck import Pluck
from engine.values.ear import Ear
from tests.app.sounds import export_sound

RATE_HZ = 8000
PLAIN = WavSettings("32f", fade_out_s=0)
SINE = np.sin(2 * np.pi * 440 * np.arange(4_000) / RATE_HZ)


def written(
    samples: np.ndarray, settings: WavSettings, tags: dict[str, str] | None = None, beside: Sequence[np.ndarray] = ()
) -> tuple[io.BytesIO, Any]:
    """A file in memory, and its report."""
    file = io.BytesIO()
    report = write_wav(file, samples, RATE_HZ, settings, tags or {}, beside)
    file.seek(0)
    return file, report


def samples_of(file: io.BytesIO) -> np.ndarray:
    return soundfile.read(file)[0]


@pytest.mark.parametrize("bits", ["16", "24", "32f"])
@pytest.mark.parametrize("normalise", [False, True])
def test_any_blocks_make_the_same_bytes_at_any_time(bits, normalise, monkeypatch):
    sound = np.random.default_rng(0).normal(size=(1000, 2)) / 3
    settings = WavSettings(bits, normalise=normalise)
    whole, level = written(sound, settings, {"title": "a"}, [2 * sound])
    monkeypatch.setattr(recording.blocks, "__defaults__", (7,))
    again, same = written(sound, settings, {"title": "a"}, [2 * sound])
    assert same == level and again.getvalue() == whole.getvalue()
    assert (level.clipped > 0) == (bits != "32f" and not normalise)
    _, chunk, behind = whole.getvalue().partition(b"PEAK")
    assert bool(chunk) == (bits == "32f") and not any(behind[8:12] if chunk else b"")  # its time of writing


def test_16_bits_have_dither_of_two_steps_without_offset_and_24_are_rounded_not_floored():
    steps = quantised(np.zeros(200_000), "16")[0].astype(np.int64) >> 16
    assert set(np.unique(steps)) <= {-1, 0, 1}
    assert abs(steps.mean()) < 0.01
    assert steps.var() == pytest.approx(0.25, rel=0.05)  # triangular: 1/6 of the draw, 1/12 of the rounding
    stored, _ = quantised(np.array([0.0, 0.4, 0.6, -0.4, -0.6]) * 2.0**-23, "24")
    assert (stored >> 8).tolist() == [0, 0, 1, 0, -1]


def test_what_is_beyond_full_scale_is_clipped_and_counted_and_silence_is_not_amplified():
    samples = np.array([0.0, 1.5, -1.5, -1.0, 0.5])
    file, level = written(samples, WavSettings("24", fade_out_s=0))
    assert level.clipped == 2
    assert level.peak_db == pytest.approx(20 * math.log10(1.5))
    assert samples_of(file).tolist() == pytest.approx([0, 1 - 2**-23, -1, -1, 0.5])
    file, level = written(samples, PLAIN)
    assert (level.clipped, samples_of(file).tolist()) == (0, samples.tolist())
    _, silent = written(np.zeros(100), WavSettings("24", normalise=True))
    assert (silent.peak_db, silent.gain_db) == (-math.inf, 0)


def test_the_end_fades_to_zero_and_the_rest_is_untouched():
    faded = faded_out(np.ones(1000), 80)
    assert (faded[:920] == 1).all()
    assert (np.diff(faded[919:]) < 0).all()
    assert faded[-1] == pytest.approx(0, abs=1e-12)
    assert faded_out(np.ones(3), 80)[-1] == pytest.approx(0, abs=1e-12)  # a fade that is longer than the sound


def test_normalising_takes_one_gain_for_all_channels_and_companions():
    settings = WavSettings("32f", normalise=True, fade_out_s=0)
    both, _ = written(np.stack([0.2 * SINE, 0.1 * SINE], axis=1), settings)
    alone, _ = written(0.1 * SINE, settings, beside=[0.2 * SINE])
    peaks = [*np.abs(samples_of(both)).max(axis=0), np.abs(samples_of(alone)).max()]
    assert peaks == pytest.approx([NORMALISED_PEAK, NORMALISED_PEAK / 2, NORMALISED_PEAK / 2], rel=1e-6)


def test_what_cannot_be_stored_is_refused():
    for samples, tags, message in (
        ([], {}, "no samples"),
        ([0.0, np.nan], {}, "not finite"),
        ([0.0] * 5, {"comment": "x" * 2001}, "comment is longer than 2000 bytes"),
    ):
        with pytest.raises(ValueError, match=message):
            written(np.array(samples), PLAIN, tags)


def test_a_disk_that_becomes_full_is_reported():
    class Full(io.BytesIO):
        def write(self, data: object) -> int:  # type: ignore[override]
            if self.tell() > 1000:
                raise OSError(28, "No space left on device")
            return super().write(data)  # type: ignore[arg-type]

    with pytest.raises(OSError, match="No space left"):
        write_wav(Full(), np.zeros(100_000), RATE_HZ, WavSettings(), {})


def test_memory_does_not_grow_with_the_duration(small_preset, tmp_path):
    settings = WavSettings("16", 192_000, normalise=True)
    peaks = []
    for seconds in (0.5, 1.0, 3.0):  # the first also pays what is loaded once
        sound = NoteSound(small_preset, Pluck(), seconds, Ear((0.37, 0.6)))
        tracemalloc.start()
        report = export_sound(sound, tmp_path / "long.wav", "truth", settings)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert report.frames == seconds * 192_000
    assert peaks[2] < peaks[1] + 2**20
