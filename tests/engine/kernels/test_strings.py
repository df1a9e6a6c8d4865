"""The laws of a string, compiled and in Python; what bends and dampers do is in `tests/app/instrument`."""

from __future__ import annotations

from dataclasses import astuple, replace
from typing import Any

import numpy as np
import pytest
from numba import njit

from engine.kernels import compiled, pulses, strings, velocities
from engine.kernels import constants as of
from engine.kernels.rotation import rotation
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters

assert strings in compiled.LAWS  # which registers them
STEEL = StringParameters(0.65, 5e-7, 2e-14, 7850.0, 2e11, 4e-4, 4e-7, 75.0)
BOTH = [StringParameters(), STEEL, replace(STEEL, youngs_modulus_pa=0.0, damping_d3_kg_m_s=0.0)]


@pytest.mark.parametrize("string", BOTH)
def test_modes_are_those_of_the_equation(string: StringParameters) -> None:
    """The closed forms, written otherwise than in the laws."""
    eta, mass = np.arange(1, 61) * np.pi / string.length_m, string.density_kg_m3 * string.area_m2
    bending, stiffness = string.youngs_modulus_pa * string.second_moment_m4, string.youngs_modulus_pa * string.area_m2
    resonator, found = resonator_of(string, 60), np.empty(4 * 60)
    strings.rows(string.row, 60, 0, 1.0, *[0.0] * 5, found)
    wanted = [
        np.sqrt((bending * eta**4 + string.tension_n * eta**2) / mass),
        (string.damping_d1_kg_m_s + string.damping_d3_kg_m_s * eta**2) / (2 * mass),
        stiffness * eta**2 / (4 * mass),
        eta**2,
    ]
    own = resonator.omega, resonator.sigma, resonator.coupling, resonator.stretch
    np.testing.assert_allclose(np.array(own), wanted, rtol=1e-13)
    np.testing.assert_allclose(found, np.concatenate([wanted[0] ** 2, *wanted[1:]]), rtol=1e-13)
    assert resonator.end_force is not None
    np.testing.assert_allclose(resonator.end_force, string.tension_n * eta + bending * eta**3, rtol=1e-13)
    assert string.pitch_hz == pytest.approx(np.sqrt(wanted[0][0] ** 2 - wanted[1][0] ** 2) / (2 * np.pi), rel=1e-13)


@njit
def _compiled(string: Any, turns: Any, rows: Any, out: Any) -> None:
    strings.rows(string, 5, 2, 1.01, 0.01, 0.002, 1.2, 1e-4, 0.02, rows)
    strings.stop(string, np.ones(8), 0.9, 300.0, np.empty(8), out[:8])
    out[8] = strings.modes_below(string, 20_000.0)
    out[9] = velocities.contact_s(3.0, 1.0, velocities.share(90.0, 0.3))
    out[10:14] = rotation(3.0, 900.0, 0.01)
    for place in range(len(turns)):
        out[14 + place] = pulses.spectrum(turns[place])
        out[20 + place] = pulses.raised_cosine(turns[place])


def test_laws_are_the_same_compiled_and_in_python() -> None:
    string, turns = np.array(astuple(STEEL)), np.array([0.0, 0.3, 0.5, 1.0, 1 + 1e-7, 7.5])
    found, wanted = (np.zeros(20), np.zeros(26)), (np.zeros(20), np.zeros(26))
    _compiled(string, turns, *found)
    _compiled.py_func(STEEL.row, turns.tolist(), *wanted)
    for one, other in zip(found, wanted, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-16)
    np.testing.assert_allclose(pulses.spectrum(turns), wanted[1][14:20], rtol=1e-13)
    np.testing.assert_allclose(pulses.raised_cosine(turns), wanted[1][20:], rtol=1e-13, atol=1e-16)
    assert wanted[1][14] == 1.0 and wanted[1][17] == wanted[1][18] == 0.5


@pytest.mark.parametrize(("place", "value"), [(of.LENGTH, 1e-3), (of.TENSION, 0.0), (of.D1, -1.0), (of.AREA, np.nan)])
def test_what_parameters_refuse_is_impossible(place: int, value: float) -> None:
    changed = np.array(STEEL.row)
    assert strings.possible(changed)
    changed[place] = value
    assert not strings.possible(changed)
    with pytest.raises(ValueError):
        StringParameters(*changed.tolist())


@pytest.mark.parametrize("place", [of.MOMENT, of.MODULUS, of.D1, of.D3])
def test_what_may_be_zero_may_be(place: int) -> None:
    changed = np.array(STEEL.row)
    changed[place] = 0.0
    assert strings.possible(changed)


def test_a_string_that_does_not_swing_is_overdamped() -> None:
    assert not strings.overdamped(STEEL.row, 60)
    assert strings.overdamped(replace(STEEL, damping_d1_kg_m_s=100.0).row, 60)
    assert strings.overdamped(replace(STEEL, damping_d3_kg_m_s=0.05).row, 60)
