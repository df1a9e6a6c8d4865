"""Pitch and numbering of partials, blind over all pitches."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.training.recording.synthetic import SyntheticNote
from training.recording.note import note_of
from training.recording.numbering import followed, number_note, peaks_of, series_at

RATE_HZ = 44_100


def stiff_note(f0_hz: float, stiffness: float, missing: tuple[int, ...] = (), seed: int = 0) -> np.ndarray:
    random = np.random.default_rng(seed)
    t = np.arange(round(1.6 * RATE_HZ)) / RATE_HZ
    sound = np.zeros(len(t))
    for k in range(1, 41):
        hz = k * f0_hz * math.sqrt(1 + stiffness * k * k)
        if hz < 9_000 and k not in missing:
            decay = 1.0 + hz / 1_500
            sound += k**-1.2 * np.exp(-decay * t) * np.sin(2 * math.pi * hz * t + random.uniform(0, 6.28))
    sound *= np.minimum(1, t / 0.002)
    return np.concatenate([np.zeros(4_000), 0.3 * sound]) + 1e-4 * random.standard_normal(len(t) + 4_000)


@pytest.mark.parametrize("f0_hz", [27.5, 41.2, 65.4, 110.0, 185.0, 330.0, 587.0, 988.0, 1_760.0, 3_520.0])
def test_pitch_is_found_blind(f0_hz: float) -> None:
    stiffness = 1e-5 if f0_hz < 500 else 1e-4
    series = number_note(note_of(stiff_note(f0_hz, stiffness), RATE_HZ))
    assert series is not None
    assert abs(1200 * math.log2(series.f0_hz / f0_hz)) < 12


def test_missing_partials_do_not_move_it_by_an_octave() -> None:
    # plucked at a third, and the first partial not radiated
    series = number_note(note_of(stiff_note(98.0, 4e-5, missing=(1, 3, 6, 9, 12)), RATE_HZ))
    assert series is not None
    assert abs(1200 * math.log2(series.f0_hz / 98.0)) < 12
    assert series.stiffness == pytest.approx(4e-5, rel=0.2)


def test_a_solved_string_is_numbered(synthetic: SyntheticNote) -> None:
    series = number_note(note_of(synthetic.samples, synthetic.rate_hz))
    assert series is not None
    assert abs(1200 * math.log2(series.f0_hz / synthetic.f0_hz)) < 20


def test_a_body_is_no_low_string_below_a_high_note() -> None:
    sound = stiff_note(2_815.0, 2e-5)
    t = np.arange(len(sound) - 4_000) / RATE_HZ
    sound[4_000:] += 0.3 * np.exp(-12 * t) * np.sin(2 * math.pi * 97 * t)
    series = number_note(note_of(sound, RATE_HZ))
    assert series is not None
    assert abs(1200 * math.log2(series.f0_hz / 2_815.0)) < 12


@pytest.mark.parametrize("cents", [-40, -15, 20])
def test_a_string_is_followed_as_it_glides(cents: float) -> None:
    peaks = peaks_of(stiff_note(110.0, 4e-5)[8_000:40_000], RATE_HZ)
    series = followed(peaks, series_at(peaks, 110.0 * 2 ** (-cents / 1200), 4e-5))
    assert abs(1200 * math.log2(series.f0_hz / 110.0)) < 2
