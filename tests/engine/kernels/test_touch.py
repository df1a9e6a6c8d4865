"""A finger on a string: the rates that it adds, compared with the modes that such a resistance couples."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.kernels import strings
from engine.kernels.strings import TOUCH_RESISTANCE
from engine.values.string import StringParameters

STRING = StringParameters(second_moment_m4=0.0, damping_d1_kg_m_s=0.0, damping_d3_kg_m_s=0.0)
MODES = 80
CLOSE = 0.2  # of a rate that is exact to first order


def added(node: int, modes: int, pairs: int = 0) -> NDArray[np.float64]:
    """σ in 1/s that a touch adds to modes (modes,)."""
    rows = np.zeros(4 * modes)
    string = np.array(astuple(STRING))
    strings.rows(string, modes, pairs, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, rows)
    strings.touch(string, modes, pairs, node, rows)
    return rows[modes : 2 * modes]


@pytest.mark.parametrize("node", [2, 3, 4, 5])
def test_rates_are_those_of_the_coupled_modes(node: int) -> None:
    """q'' + 2R/(ρAℓ) φ φᵀ q' + ω² q = 0, with φ the modes at the finger: all its eigenvalues, of the lowest modes."""
    omega = np.array([STRING.undamped_frequency(mode) for mode in range(1, MODES + 1)])
    at_finger = np.sin(np.arange(1, MODES + 1) * np.pi / node)
    resistance = TOUCH_RESISTANCE * np.sqrt(STRING.tension_n * STRING.density_kg_m3 * STRING.area_m2)
    mass = STRING.density_kg_m3 * STRING.area_m2 * STRING.length_m
    coupling = 2 * resistance / mass * np.outer(at_finger, at_finger)
    zero, one = np.zeros((MODES, MODES)), np.eye(MODES)
    found = np.linalg.eigvals(np.block([[zero, one], [-np.diag(omega**2), -coupling]]))
    found = found[found.imag > omega[0] / 2]
    exact = -found[np.argsort(found.imag)].real[: 2 * node]
    rates = added(node, 2 * node)
    ringing = np.arange(1, 2 * node + 1) % node == 0
    np.testing.assert_allclose(exact[ringing], 0.0, atol=1e-6 * omega[0])
    np.testing.assert_allclose(rates[ringing], 0.0, atol=1e-6 * omega[0])
    np.testing.assert_allclose(rates[~ringing], exact[~ringing], rtol=CLOSE)


def test_both_polarisations_of_a_partial_are_touched_alike() -> None:
    np.testing.assert_allclose(added(3, 8, 4)[::2], added(3, 8, 4)[1::2])
    np.testing.assert_allclose(added(3, 8, 4)[::2], added(3, 4))
