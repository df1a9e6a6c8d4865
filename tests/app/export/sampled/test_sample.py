"""Notes as they are stored, and the levels of velocities between those that were rendered."""

from __future__ import annotations

import io

import numpy as np
import pytest
import soundfile

from app.export.sampled.levels import headroom_db, velocity_levels
from app.export.sampled.sample import (
    CUT_FADE_S,
    END_FADE_S,
    FEWEST_FRAMES,
    PEAK_DBFS,
    StoredSample,
    encoded,
    sample_of,
)
from app.instruments.instrument import Instrument
from tests.app.export.sampled.conftest import RATE_HZ, instrument_of, small


def decaying(t60_s: float, seconds: float, level: float = 0.1) -> np.ndarray:
    time_s = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    return (level * 10 ** (-3 * time_s / t60_s) * np.sin(2 * np.pi * 220 * time_s))[:, None].astype(np.float32)


def test_a_note_ends_where_it_is_silent_and_is_faded_out_where_it_still_rings() -> None:
    sound, sample = sample_of(decaying(1.0, 3.0), RATE_HZ)
    assert not sample.cut
    assert len(sound) / RATE_HZ == pytest.approx(1.5 + END_FADE_S, abs=0.01)  # 90 dB at 60 dB/s
    assert np.abs(sound[-10:]).max() < 1e-6
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


def test_silence_is_a_sample_too_and_what_is_no_note_is_refused() -> None:
    sound, sample = sample_of(np.zeros((1000, 2), np.float32), RATE_HZ)
    assert sound.shape == (FEWEST_FRAMES, 2)
    assert not sound.any()
    assert (sample.gain_db, sample.level_db, sample.cut) == (0.0, -120.0, False)
    assert len(sample_of(np.ones((5, 1), np.float32), RATE_HZ)[0]) == FEWEST_FRAMES
    with pytest.raises(ValueError, match="not finite"):
        sample_of(np.full((100, 1), np.nan), RATE_HZ)
    for shape in ((0, 1), (100,), (100, 3)):
        with pytest.raises(ValueError, match="no sound"):
            sample_of(np.zeros(shape), RATE_HZ)


@pytest.mark.parametrize("form", ["flac", "wav"])
@pytest.mark.parametrize(("bits", "error"), [("16", 2**-14), ("24", 2**-23)])
def test_a_file_holds_the_sample_and_is_the_same_each_time(form: str, bits: str, error: float) -> None:
    sound, _ = sample_of(np.hstack([decaying(1.0, 0.2), decaying(0.5, 0.2)]), RATE_HZ)
    data = encoded(sound, RATE_HZ, form, bits)
    assert encoded(sound, RATE_HZ, form, bits) == data
    with soundfile.SoundFile(io.BytesIO(data)) as file:
        assert (file.format, file.subtype, file.samplerate) == (form.upper(), f"PCM_{bits}", RATE_HZ)
        np.testing.assert_allclose(file.read(), sound, atol=error)


# Levels


def stored(level_db: float) -> StoredSample:
    return StoredSample(frames=64, channels=1, gain_db=0.0, level_db=level_db)


def rendered(instrument: Instrument, layers: int) -> list[int]:
    return [zone.velocity for zone in small(instrument, keys=(60, 60), layers=layers).zones]


def levels(instrument: Instrument, *measured_db: float) -> np.ndarray:
    layers = list(small(instrument, keys=(60, 60), layers=len(measured_db)).zones)
    return velocity_levels(instrument, layers, [stored(level) for level in measured_db])


@pytest.mark.parametrize("curve", [-0.5, 0.0, 0.5])
def test_a_string_follows_its_plucks_at_every_velocity_also_where_a_layer_is_silent(curve: float) -> None:
    instrument = instrument_of(pluck={"curve": curve})
    wanted = 20 * np.log10([instrument.pluck.pluck(velocity).amplitude_mm for velocity in range(128)])
    for layers in (1, 2, 3):
        np.testing.assert_allclose(levels(instrument, *wanted[rendered(instrument, layers)]), wanted, atol=1e-9)
    hardest = rendered(instrument, 2)[-1]
    np.testing.assert_allclose(levels(instrument, -120.0, -20.0), wanted - wanted[hardest] - 20)


def test_what_was_measured_holds_where_it_was_and_headroom_is_up_to_the_loudest_velocity() -> None:
    instrument = instrument_of()
    found = levels(instrument, -40.0, -25.0, -22.0)
    first, second, third = rendered(instrument, 3)
    assert list(found[[first, second, third]]) == pytest.approx([-40, -25, -22])
    assert (np.diff(found[1:]) > 0).all()
    # as steep as between the nearest two
    assert found[first] - found[1] == pytest.approx(15 * (first - 1) / (second - first))
    assert found[127] - found[third] == pytest.approx(3 * (127 - third) / (third - second))
    zones, two_db = small(instrument, keys=(60, 60), layers=2).zones, levels(instrument, -30.0, -20.0)
    rooms = headroom_db(instrument, {zone: stored(level) for zone, level in zip(zones, [-30.0, -20.0], strict=True)})
    assert list(rooms.values()) == pytest.approx([two_db[63] + 30, two_db[127] + 20])
    assert min(rooms.values()) > 1


def test_plucks_of_one_strength_differ_in_width_alone() -> None:
    instrument = instrument_of(pluck={"softest_mm": 2.0, "hardest_mm": 2.0})
    first, second = rendered(instrument, 2)
    between = levels(instrument, -30.0, -26.0)[first : second + 1]
    assert between == pytest.approx(np.linspace(-30, -26, second - first + 1))
