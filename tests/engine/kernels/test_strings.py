"""The compiled strings against `StringParameters`; what bends and dampers do is in `tests/app/instrument`."""

from __future__ import annotations

from dataclasses import astuple, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.kernels import constants as of
from engine.kernels import strings
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters

STEEL = StringParameters(0.65, 5e-7, 2e-14, 7850.0, 2e11, 4e-4, 4e-7, 75.0)
BOTH = [StringParameters(), STEEL, replace(STEEL, youngs_modulus_pa=0.0, damping_d3_kg_m_s=0.0)]


def row(string: StringParameters) -> NDArray[np.float64]:
    return np.array(astuple(string))


@pytest.mark.parametrize("string", BOTH)
def test_modes_are_those_of_the_parameters(string: StringParameters) -> None:
    found = np.empty(4 * 60)
    strings.rows(row(string), 60, 0, 1.0, *[0.0] * 5, found)
    resonator = resonator_of(string, 60)
    own = resonator.omega**2, resonator.sigma, resonator.coupling, resonator.stretch
    np.testing.assert_allclose(found, np.concatenate(own), rtol=1e-13)
    for mode in (1, 7):
        assert strings.decay_rate(row(string), mode) == pytest.approx(string.decay_rate(mode), rel=1e-14)
        assert strings.omega_squared(row(string), mode) == pytest.approx(string.undamped_frequency(mode) ** 2)
    for frequency_hz in (100.0, 3_333.0, 20_000.0):
        assert strings.modes_below(row(string), frequency_hz) == string.modes_below(frequency_hz)


@pytest.mark.parametrize(("place", "value"), [(of.LENGTH, 1e-3), (of.TENSION, 0.0), (of.D1, -1.0), (of.AREA, np.nan)])
def test_what_parameters_refuse_is_impossible(place: int, value: float) -> None:
    changed = row(STEEL)
    assert strings.possible(changed)
    changed[place] = value
    assert not strings.possible(changed)
    with pytest.raises(ValueError):
        StringParameters(*changed.tolist())


@pytest.mark.parametrize("place", [of.MOMENT, of.MODULUS, of.D1, of.D3])
def test_what_may_be_zero_may_be(place: int) -> None:
    changed = row(STEEL)
    changed[place] = 0.0
    assert strings.possible(changed)


def test_a_string_that_does_not_swing_is_overdamped() -> None:
    assert not strings.overdamped(row(STEEL), 60)
    assert strings.overdamped(row(replace(STEEL, damping_d1_kg_m_s=100.0)), 60)
    assert strings.overdamped(row(replace(STEEL, damping_d3_kg_m_s=0.05)), 60)
