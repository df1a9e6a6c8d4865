"""What an ear finds, on sounds that are known: sums of decaying partials, changed in one way at a time."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.compare.audible import FLOOR_DB, audible_errors, heard_level_db

RATE_HZ = 24_000
PARTIALS_HZ = tuple(247.0 * n for n in range(1, 9))
SECONDS = 4.0
TIME_S = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ

Sound = NDArray[np.float64]


def string(cents: float = 0.0, decay_db_s: float = 6.0) -> Sound:
    """Partials of 6 dB an octave that decay alike."""
    ratio = 2 ** (cents / 1200)
    partials = (np.cos(2 * np.pi * hz * ratio * TIME_S + n) / (n + 1) for n, hz in enumerate(PARTIALS_HZ))
    return 0.1 * sum(partials, np.zeros_like(TIME_S)) * 10 ** (-decay_db_s / 20 * TIME_S)


def drifting(change_db: float) -> Sound:
    """A gain that changes between 1 and 2.5 s."""
    return 10 ** (change_db / 20 * np.interp(TIME_S, (1, 2.5), (0, 1)))


def errors(model: Sound, truth: Sound | None = None):
    return audible_errors(model, string() if truth is None else truth, RATE_HZ, PARTIALS_HZ, 0.25)


def test_the_truth_itself_has_no_errors_whatever_its_phase_and_level() -> None:
    same = errors(string())
    assert (same.distance_db, same.level_db, same.rise_db, same.split_cents) == (0, 0, 0, None)
    assert same.pitch_cents == 0
    turned = errors(-string())
    assert turned.distance_db == pytest.approx(0, abs=1e-9)
    assert turned.pitch_cents == pytest.approx(0, abs=1e-9)
    assert errors(2 * string()).level_db == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("cents", (-40.0, -13.0, 3.0, 13.0))
def test_a_detuned_string_is_reported_in_cents_and_only_so(cents: float) -> None:
    found = errors(string(cents))
    assert found.pitch_cents == pytest.approx(cents, abs=0.1)
    assert (found.split_cents, found.rise_db) == (None, 0)
    assert abs(found.level_db) < 0.05
    assert found.distance_db > 1


@pytest.mark.parametrize("change_db", (-8.0, -2.0, 5.0))
def test_a_level_that_changes_is_reported_against_the_truths(change_db: float) -> None:
    """A rise is one of the model's own level: the string's own decay is faster, or there is none."""
    found = errors(drifting(change_db) * string())
    assert found.level_db == pytest.approx(change_db, abs=0.01)
    assert found.pitch_cents == pytest.approx(0, abs=0.05)
    assert found.rise_db == 0
    assert 0.4 < found.distance_db / abs(change_db) < 0.6
    rise_db = errors(drifting(change_db) * string(decay_db_s=0)).rise_db
    assert rise_db == pytest.approx(max(change_db, 0), abs=0.01)


@pytest.mark.parametrize("cents", (6.0, 22.0, 40.0))
def test_two_pitches_where_the_truth_has_one_are_reported_with_their_distance(cents: float) -> None:
    both = string() + 0.5 * string(cents)
    found = errors(both)
    assert found.split_cents == pytest.approx(cents, abs=0.5)
    assert found.pitch_cents == pytest.approx(0, abs=0.5)
    assert errors(string() + 0.05 * string(cents)).split_cents is None  # 26 dB below: its level swings by 0.9 dB
    assert errors(both, both).split_cents is None


def test_what_is_not_heard_does_not_count_and_silence_is_finite() -> None:
    """A string that rests beside its place, and what lies far below the loudest."""
    hiss, silent = 1e-6 * np.random.default_rng(0).standard_normal(len(TIME_S)), np.zeros_like(TIME_S)
    for beside in (0.05, hiss):
        found = errors(string() + beside)
        assert found.level_db == pytest.approx(0, abs=0.01)
        assert found.distance_db < 0.01
    assert errors(np.where(TIME_S < 1, string(), 0)).level_db == -FLOOR_DB
    assert errors(silent).pitch_cents is None
    assert errors(silent, silent).distance_db == 0
    assert np.isfinite(errors(string(), silent).distance_db)


def test_sounds_of_two_lengths_and_too_short_ones_are_refused() -> None:
    with pytest.raises(ValueError, match="differ in shape"):
        errors(string()[:-1])
    with pytest.raises(ValueError, match="less than a frame"):
        audible_errors(string()[:100], string()[:100], RATE_HZ, PARTIALS_HZ, 0.25)
    found = audible_errors(string(), string(), RATE_HZ, [hz for hz in PARTIALS_HZ if hz > RATE_HZ], 0.25)
    assert (found.pitch_cents, found.split_cents) == (None, None)  # whose partials cannot be made


def test_a_level_is_a_sines_amplitude_whatever_it_rests_on() -> None:
    time_s = np.arange(RATE_HZ // 2) / RATE_HZ
    for hz in (247.0, 1003.3):
        assert heard_level_db(1e-3 * np.sin(2 * np.pi * hz * time_s) + 0.1, RATE_HZ) == pytest.approx(-60, abs=0.1)
    assert heard_level_db(0.5 * np.sin(2 * np.pi * 4 * time_s), RATE_HZ) < -60  # nobody hears it
    assert heard_level_db(np.zeros(RATE_HZ // 2), RATE_HZ) == -200
