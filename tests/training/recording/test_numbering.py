"""Pitch and numbering of partials, blind over all pitches."""

import math

import numpy as np
import pytest

from tests.training.recording.synthetic import synthetic_note
from training.recording.note import note_of
from training.recording.numbering import number_note

RATE_HZ = 44_100


def stiff_note(f0_hz: float, stiffness: float, missing: tuple[int, ...] = ()) -> np.ndarray:
    random = np.random.default_rng(0)
    t = np.arange(round(1.6 * RATE_HZ)) / RATE_HZ
    sound = np.zeros(len(t))
    for k in range(1, 41):
        hz = k * f0_hz * math.sqrt(1 + stiffness * k * k)
        if hz < 9_000 and k not in missing:
            decay = 1.0 + hz / 1_500
            sound += k**-1.2 * np.exp(-decay * t) * np.sin(2 * math.pi * hz * t + random.uniform(0, 6.28))
    sound *= np.minimum(1, t / 0.002)
    return np.concatenate([np.zeros(4_000), 0.3 * sound]) + 1e-4 * random.standard_normal(len(t) + 4_000)


def cents(found_hz: float, f0_hz: float) -> float:
    return abs(1200 * math.log2(found_hz / f0_hz))


@pytest.mark.parametrize("f0_hz", [27.5, 65.4, 110.0, 330.0, 988.0, 3_520.0])
def test_pitch_and_stiffness_are_found_blind(f0_hz):
    stiffness = 1e-5 if f0_hz < 500 else 1e-4
    series = number_note(note_of(stiff_note(f0_hz, stiffness), RATE_HZ))
    assert series is not None and cents(series.f0_hz, f0_hz) < 12
    if 30 < f0_hz < 500:
        assert series.stiffness == pytest.approx(stiffness, rel=0.25, abs=2e-6)
        assert series.present[:3] == (1, 2, 3)


@pytest.mark.parametrize(("f0_hz", "missing"), [(98.0, (1, 3, 6, 9, 12)), (196.0, (2, 4, 6, 8)), (147.0, (1, 5, 10))])
def test_partials_that_are_not_plucked_or_not_radiated_do_not_move_it_by_an_octave(f0_hz, missing):
    series = number_note(note_of(stiff_note(f0_hz, 4e-5, missing), RATE_HZ))
    assert series is not None and cents(series.f0_hz, f0_hz) < 12
    assert series.stiffness == pytest.approx(4e-5, rel=0.2)
    assert not {*missing} & {*series.present}


@pytest.mark.parametrize("seed", range(40, 45))
def test_a_solved_string_of_any_pitch_with_a_body_is_numbered(seed):
    """Its law holds every loud partial: second polarisation, body, noise and glide do not mislead it."""
    made = synthetic_note(seed, seconds=1.0, f0_range_hz=(30, 1_000), highest_hz=9_000)
    series = number_note(note_of(made.samples, made.rate_hz))
    assert series is not None and cents(series.f0_hz, made.f0_hz) < 20
    loudest = max(each.level_db for each in made.partials)
    loud = [each for each in made.partials if each.level_db > loudest - 30]
    law = series.partials_hz(len(made.partials))
    assert max(cents(law[each.number - 1], each.hz) for each in loud) < 25
    np.testing.assert_array_equal(series.numbers_of(np.array([each.hz for each in loud])), [p.number for p in loud])


@pytest.mark.parametrize(("f0_hz", "body_hz"), [(2_815.0, 97.0), (1_200.0, 100.0), (588.0, 196.0), (392.0, 196.0)])
def test_a_body_is_no_low_string_below_a_high_note(f0_hz, body_hz):
    """Also where every partial of the note would be one of that low string."""
    sound = stiff_note(f0_hz, 2e-5)
    t = np.arange(len(sound) - 4_000) / RATE_HZ
    sound[4_000:] += 0.3 * np.exp(-12 * t) * np.sin(2 * math.pi * body_hz * t)
    series = number_note(note_of(sound, RATE_HZ))
    assert series is not None and cents(series.f0_hz, f0_hz) < 12


def test_high_rates_are_converted_channels_combined_and_the_louder_of_unlike_ones_is_taken(synthetic):
    twice = np.repeat(synthetic.samples, 4)  # a crude 176.4 kHz
    note = note_of(np.stack([twice, twice], 1), 4 * synthetic.rate_hz)
    assert note.rate_hz == synthetic.rate_hz
    assert note.onset == pytest.approx(0.1 * note.rate_hz, abs=0.005 * note.rate_hz)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(len(synthetic.samples))
    note = note_of(np.stack([noise, synthetic.samples], 1), synthetic.rate_hz)
    assert np.allclose(note.samples, synthetic.samples - synthetic.samples.mean())


@pytest.mark.parametrize("rate_hz", [88_200, 96_000, 64_000])
def test_a_high_rate_has_the_tones_of_a_low_one_and_nothing_folded(rate_hz):
    def recorded(hz: float, at_hz: int) -> np.ndarray:
        time_s = np.arange(at_hz // 2) / at_hz
        return np.sin(2 * np.pi * hz * time_s) * np.hanning(len(time_s) + 1)[:-1]

    tone, above = 18_000.0, 29_000.0  # the second is above half the rate that is fitted
    note = note_of(recorded(tone, rate_hz) + recorded(above, rate_hz), rate_hz)
    expected = recorded(tone, note.rate_hz)[: len(note.samples)]
    assert np.linalg.norm(note.samples[: len(expected)] - expected) < 1e-4 * np.linalg.norm(expected)
