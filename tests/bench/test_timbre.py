"""Figures of timbre, on sounds for which they are known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from app.patches.library import SHIPPED, find_patch
from tests.bench import timbre as t

FIRST_HZ = 200.0
PARTIALS_HZ = FIRST_HZ * np.arange(1, 31)
TIME_S = np.arange(round(t.NOTE_S * t.RATE_HZ)) / t.RATE_HZ


def rung(amplitudes, t60_s: float = 2.0) -> np.ndarray:
    fall = np.exp(-math.log(1000) / t60_s * TIME_S)
    sines = np.sin(2 * np.pi * np.multiply.outer(PARTIALS_HZ[: len(amplitudes)], TIME_S))
    return fall * (np.asarray(amplitudes) @ sines)


def test_the_centroid_is_weighted_by_power_and_the_roll_off_holds_99_percent() -> None:
    amplitudes = 1 / np.arange(1, 31)
    power = amplitudes**2
    first = t.attack(rung(amplitudes), FIRST_HZ)
    assert t.centroid_hz(first) == pytest.approx(np.average(PARTIALS_HZ, weights=power), rel=0.01)
    summed = np.cumsum(power) / power.sum()
    assert t.rolloff_hz(first) == pytest.approx(PARTIALS_HZ[np.searchsorted(summed, 0.99)], abs=40)


def test_partials_have_their_levels_and_one_that_is_missing_has_none() -> None:
    found = t.partials_db(rung(1 / np.arange(1, 31)), PARTIALS_HZ[:8])
    np.testing.assert_allclose(found[:8], -20 * np.log10(np.arange(1, 9)), atol=0.05)
    assert np.isnan(found[8:]).all()


@pytest.mark.parametrize(("hz", "figure"), [(300.0, t.between_db), (80.0, t.below_db)])
def test_what_is_no_partial_is_found_at_its_level(hz: float, figure) -> None:
    clean = rung([1.0, 0.5])
    other = clean + 0.1 * np.exp(-math.log(1000) / 2 * TIME_S) * np.sin(2 * np.pi * hz * TIME_S)
    assert figure(t.attack(clean, FIRST_HZ), PARTIALS_HZ) < -40
    assert figure(t.attack(other, FIRST_HZ), PARTIALS_HZ) == pytest.approx(10 * math.log10(0.01 / 1.26), abs=0.3)


def test_two_decays_are_reported_apart() -> None:
    sound = rung([1.0], 1.0) + 0.003 * rung([1.0], 6.0)
    assert t.t60_s(rung([1.0], 2.0), t.EARLY_S) == pytest.approx(2.0, rel=0.01)
    assert t.t60_s(sound, t.EARLY_S) == pytest.approx(1.02, rel=0.03)
    assert t.t60_s(sound, t.LATE_S) == pytest.approx(6.0, rel=0.02)
    assert math.isnan(t.t60_s(0 * sound, t.EARLY_S))


def test_beating_is_ripple() -> None:
    steady = rung([1.0])
    beating = steady + 0.2 * np.exp(-math.log(1000) / 2 * TIME_S) * np.sin(2 * np.pi * (FIRST_HZ + 3) * TIME_S)
    assert t.ripple_db(steady, PARTIALS_HZ, 0) < 0.02
    assert t.ripple_db(beating, PARTIALS_HZ, 0) == pytest.approx(20 * math.log10(1.2) / math.sqrt(2), abs=0.2)


def test_ranges_of_an_instrument_go_before_the_general_ones() -> None:
    steel = t.references_of("steel_string_acoustic", acoustic=True)
    assert (steel["centroid_hz"].low, steel["ripple_db"].high) == (900, 5)
    assert "ripple_db" not in t.references_of("electric_bass", acoustic=False)
    for path in sorted(SHIPPED.glob("*.json")):  # whatever is printed has a range
        assert t.references_of(path.stem, acoustic=False)
    for reference in t.REFERENCES:
        assert reference.taken and reference.low < reference.high
        assert all(find_patch(name) for name in reference.patches)


def test_keys_are_those_of_the_reference_or_their_octaves() -> None:
    expected = {"classical_guitar": 52, "harpsichord": 60, "ukulele_low_g": 64}
    assert {name: t.measured_key(find_patch(name).patch) for name in expected} == expected
