"""What is planned for samplers: keys and velocities by sample, notes as they are stored, and levels between them."""

import io

import numpy as np
import pytest
import soundfile
from hypothesis import given, settings
from hypothesis import strategies as st

from app.export.sampled.levels import velocity_levels
from app.export.sampled.plan import MOST_LAYERS, WIDEST_STEP, SampledPlan
from app.export.sampled.sample import StoredSample, encoded, sample_of
from app.instruments.instrument import Instrument
from app.player.glide import glides_cents
from tests.app.export.sampled.conftest import RATE_HZ, instrument_of, small

WHOLE = instrument_of(range=(0, 127))


@given(
    st.tuples(st.integers(0, 127), st.integers(0, 127)).map(lambda ends: (min(ends), max(ends))),
    st.integers(1, WIDEST_STEP),
    st.integers(1, MOST_LAYERS),
)
@settings(max_examples=60, deadline=None)
def test_each_key_and_velocity_has_one_zone(keys, every, layers):
    sounded = [
        (key, velocity)
        for zone in SampledPlan(WHOLE, keys, every, layers).zones
        for key in range(zone.keys[0], zone.keys[1] + 1)
        for velocity in range(zone.velocities[0], zone.velocities[1] + 1)
    ]
    assert sorted(sounded) == [(k, v) for k in range(keys[0], keys[1] + 1) for v in range(1, 128)]


@pytest.mark.parametrize("every", [1, 3])
def test_a_layer_is_rendered_where_its_largest_error_of_pitch_is_least(every):
    plan = SampledPlan(instrument_of(pluck={"hardest_mm": 20.0}), layers=3, every=every)
    zones, glides = [zone for zone in plan.zones if 50 in zone.keys], glides_cents(plan.instrument)
    assert [zone.velocities for zone in zones] == [(1, 42), (43, 84), (85, 127)]
    for zone in zones:
        (low, high), (softest, hardest) = zone.keys, zone.velocities
        notes = glides[low : high + 1, softest : hardest + 1]
        errors = [np.abs(notes - glides[zone.key, velocity]).max() for velocity in range(softest, hardest + 1)]
        assert errors[zone.velocity - softest] == min(errors) <= plan.pitch_error_cents
        assert errors[-1] > 1.5 * min(errors)  # as it was rendered at the hardest
    assert plan.pitch_error_cents > 10
    assert SampledPlan(plan.instrument, layers=32, every=every).pitch_error_cents < 0.5 * plan.pitch_error_cents


FIVE = {"scale": "! five.scl\nfive equal steps\n 5\n 240.\n 480.\n 720.\n 960.\n 2/1\n"}
WHITE = {"keymap": "12\n0\n127\n60\n69\n440.0\n12\n0\nx\n2\nx\n4\n5\nx\n7\nx\n9\nx\n11\n"}


def test_a_tuning_is_never_transposed_and_keys_that_it_leaves_out_have_no_sample():
    assert SampledPlan(instrument_of(tuning=FIVE)).every == 1
    zones = SampledPlan(instrument_of(tuning=WHITE), (48, 59)).zones
    assert {zone.key for zone in zones} == {48, 50, 52, 53, 55, 57, 59}


# Notes


def decaying(t60_s: float, seconds: float, level: float = 0.1) -> np.ndarray:
    time_s = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    return (level * 10 ** (-3 * time_s / t60_s) * np.sin(2 * np.pi * 220 * time_s))[:, None].astype(np.float32)


def test_a_note_ends_where_it_is_silent_and_is_faded_out_where_it_still_rings():
    sound, sample = sample_of(decaying(1.0, 3.0), RATE_HZ)
    assert not sample.cut
    assert len(sound) / RATE_HZ == pytest.approx(1.5 + 0.02, abs=0.01)  # 90 dB at 60 dB/s
    assert np.abs(sound[-10:]).max() < 1e-6
    rendered = decaying(10.0, 3.0)
    sound, sample = sample_of(rendered, RATE_HZ)
    assert sample.cut
    assert len(sound) == len(rendered)
    untouched = len(rendered) - round(0.5 * RATE_HZ)
    back = sound * 10 ** (-sample.gain_db / 20)
    np.testing.assert_allclose(back[:untouched], rendered[:untouched], rtol=1e-6, atol=1e-9)
    assert abs(back[-1, 0]) < 1e-9
    assert np.abs(np.diff(back[:, 0])).max() < 1.1 * np.abs(np.diff(rendered[:, 0])).max()


@pytest.mark.parametrize("level", [1e-4, 0.1, 1.0, 3.0])
def test_the_peak_is_full_and_the_gain_says_by_how_much(level):
    rendered = decaying(1.0, 2.0, level)
    sound, sample = sample_of(rendered, RATE_HZ)
    peak_db = 20 * np.log10(np.abs(sound).max())
    assert -1.011 < peak_db <= -1
    assert sample.gain_db == pytest.approx(peak_db - 20 * np.log10(np.abs(rendered).max()), abs=1e-3)
    assert sample.level_db == pytest.approx(10 * np.log10(np.mean(rendered[:19_200].astype(float) ** 2)), abs=1e-6)
    assert round(sample.gain_db, 2) == sample.gain_db  # as an SFZ file says it


def test_silence_is_a_sample_too_and_what_is_no_note_is_refused():
    sound, sample = sample_of(np.zeros((1000, 2), np.float32), RATE_HZ)
    assert sound.shape == (64, 2)
    assert not sound.any()
    assert (sample.gain_db, sample.level_db, sample.cut) == (0.0, -120.0, False)
    assert len(sample_of(np.ones((5, 1), np.float32), RATE_HZ)[0]) == 64
    with pytest.raises(ValueError, match="not finite"):
        sample_of(np.full((100, 1), np.nan), RATE_HZ)
    for shape in ((0, 1), (100,), (100, 3)):
        with pytest.raises(ValueError, match="no sound"):
            sample_of(np.zeros(shape), RATE_HZ)


@pytest.mark.parametrize("form", ["flac", "wav"])
@pytest.mark.parametrize(("bits", "error"), [("16", 2**-14), ("24", 2**-23)])
def test_a_file_holds_the_sample_and_is_the_same_each_time(form, bits, error):
    sound, _ = sample_of(np.hstack([decaying(1.0, 0.2), decaying(0.5, 0.2)]), RATE_HZ)
    data = encoded(sound, RATE_HZ, form, bits)
    assert encoded(sound, RATE_HZ, form, bits) == data
    with soundfile.SoundFile(io.BytesIO(data)) as file:
        assert (file.format, file.subtype, file.samplerate) == (form.upper(), f"PCM_{bits}", RATE_HZ)
        np.testing.assert_allclose(file.read(), sound, atol=error)


# Levels


def rendered(instrument: Instrument, layers: int) -> list[int]:
    return [zone.velocity for zone in small(instrument, keys=(60, 60), layers=layers).zones]


def levels(instrument: Instrument, *measured_db: float) -> np.ndarray:
    layers = list(small(instrument, keys=(60, 60), layers=len(measured_db)).zones)
    return velocity_levels(instrument, layers, [StoredSample(64, 1, 0.0, level) for level in measured_db])


@pytest.mark.parametrize("curve", [-0.5, 0.0, 0.5])
def test_a_string_follows_its_plucks_at_every_velocity_also_where_a_layer_is_silent(curve):
    instrument = instrument_of(pluck={"curve": curve})
    wanted = 20 * np.log10([instrument.pluck.pluck(velocity).amplitude_mm for velocity in range(128)])
    for layers in (1, 2, 3):
        np.testing.assert_allclose(levels(instrument, *wanted[rendered(instrument, layers)]), wanted, atol=1e-9)
    hardest = rendered(instrument, 2)[-1]
    np.testing.assert_allclose(levels(instrument, -120.0, -20.0), wanted - wanted[hardest] - 20)
