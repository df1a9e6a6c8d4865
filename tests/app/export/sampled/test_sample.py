from __future__ import annotations

import io

import numpy as np
import pytest
import soundfile

from app.export.sampled.sample import CUT_FADE_S, END_FADE_S, FEWEST_FRAMES, PEAK_DBFS, encoded, sample_of

RATE_HZ = 48_000


def decaying(t60_s: float, seconds: float, level: float = 0.1) -> np.ndarray:
    time_s = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    return (level * 10 ** (-3 * time_s / t60_s) * np.sin(2 * np.pi * 220 * time_s))[:, None].astype(np.float32)


def test_a_note_ends_where_it_is_silent() -> None:
    sound, sample = sample_of(decaying(1.0, 3.0), RATE_HZ)
    assert not sample.cut
    assert len(sound) / RATE_HZ == pytest.approx(1.5 + END_FADE_S, abs=0.01)  # 90 dB at 60 dB/s
    assert np.abs(sound[-10:]).max() < 1e-6


def test_a_note_that_still_rings_is_faded_out() -> None:
    rendered = decaying(10.0, 3.0)
    sound, sample = sample_of(rendered, RATE_HZ)
    assert sample.cut
    assert len(sound) == len(rendered)
    untouched = len(rendered) - round(CUT_FADE_S * RATE_HZ)
    back = sound * 10 ** (-sample.gain_db / 20)
    np.testing.assert_allclose(back[:untouched], rendered[:untouched], rtol=1e-6, atol=1e-9)
    assert abs(back[-1, 0]) < 1e-9
    assert np.abs(np.diff(back[:, 0])).max() < 1.1 * np.abs(np.diff(rendered[:, 0])).max()


@pytest.mark.parametrize("level", [1e-4, 0.1, 1.0, 3.0])
def test_the_peak_is_full_and_the_gain_says_by_how_much(level: float) -> None:
    rendered = decaying(1.0, 2.0, level)
    sound, sample = sample_of(rendered, RATE_HZ)
    peak_db = 20 * np.log10(np.abs(sound).max())
    assert PEAK_DBFS - 0.011 < peak_db <= PEAK_DBFS
    assert sample.gain_db == pytest.approx(peak_db - 20 * np.log10(np.abs(rendered).max()), abs=1e-3)
    assert sample.level_db == pytest.approx(10 * np.log10(np.mean(rendered[:19_200].astype(float) ** 2)), abs=1e-6)
    assert round(sample.gain_db, 2) == sample.gain_db  # as an SFZ file says it


def test_silence_is_a_sample_too() -> None:
    sound, sample = sample_of(np.zeros((1000, 2), np.float32), RATE_HZ)
    assert sound.shape == (FEWEST_FRAMES, 2)
    assert not sound.any()
    assert (sample.gain_db, sample.level_db, sample.cut) == (0.0, -120.0, False)
    assert len(sample_of(np.ones((5, 1), np.float32), RATE_HZ)[0]) == FEWEST_FRAMES


@pytest.mark.parametrize(
    ("rendered", "reported"),
    [
        (np.full((100, 1), np.nan), "not finite"),
        (np.zeros((0, 1)), "no sound"),
        (np.zeros(100), "no sound"),
        (np.zeros((100, 3)), "no sound"),
    ],
)
def test_what_is_no_note_is_refused(rendered: np.ndarray, reported: str) -> None:
    with pytest.raises(ValueError, match=reported):
        sample_of(rendered, RATE_HZ)


@pytest.mark.parametrize("form", ["flac", "wav"])
@pytest.mark.parametrize(("bits", "error"), [("16", 2**-14), ("24", 2**-23)])
def test_a_file_holds_the_sample_and_is_the_same_each_time(form: str, bits: str, error: float) -> None:
    sound, _ = sample_of(np.hstack([decaying(1.0, 0.2), decaying(0.5, 0.2)]), RATE_HZ)
    data = encoded(sound, RATE_HZ, form, bits)
    assert encoded(sound, RATE_HZ, form, bits) == data
    with soundfile.SoundFile(io.BytesIO(data)) as file:
        assert (file.format, file.subtype, file.samplerate) == (form.upper(), f"PCM_{bits}", RATE_HZ)
        np.testing.assert_allclose(file.read(), sound, atol=error)
