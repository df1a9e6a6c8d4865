"""The string's closed forms."""

import math

import numpy as np
import pytest

from engine.resonators.string import decay_rates, resonator_of, undamped_frequencies, wavenumbers
from engine.values.string import StringParameters


def test_default_is_the_papers_b3() -> None:
    string = StringParameters()
    fundamental_hz = float(undamped_frequencies(string, 1)[0]) / (2 * math.pi)
    assert fundamental_hz == pytest.approx(246.94, abs=0.5)  # B3


def test_a_string_without_stiffness_is_harmonic() -> None:
    frequencies = undamped_frequencies(StringParameters(second_moment_m4=0), 5)
    np.testing.assert_allclose(frequencies / frequencies[0], np.arange(1, 6))


def test_eigenvalues_solve_the_characteristic_equation() -> None:
    string = StringParameters()
    s = resonator_of(string, 25).eigenvalues()
    residual = s**2 + 2 * decay_rates(string, 25) * s + undamped_frequencies(string, 25) ** 2
    assert float((np.abs(residual) / np.abs(s) ** 2).max()) < 1e-14


def test_relative_tension_rise_is_the_stretch_of_the_shape() -> None:
    """EA/2ℓ ∫ y'² dx / T₀ by quadrature of a shape with three modes."""
    string = StringParameters()
    amplitudes = np.array([3e-3, -1e-3, 2e-3])
    x = np.linspace(0, string.length_m, 20_001)
    eta = wavenumbers(string, 3)
    slope = (amplitudes * eta * np.cos(eta * x[:, None])).sum(1)
    stretch = float(np.trapezoid(slope**2, x))
    expected = string.youngs_modulus_pa * string.area_m2 / (2 * string.length_m) * stretch / string.tension_n
    assert float(resonator_of(string, 3).relative_tension_rise(amplitudes)) == pytest.approx(expected, rel=1e-6)


def test_modes_below() -> None:
    string = StringParameters()
    count = string.modes_below(20_000)
    frequencies_hz = undamped_frequencies(string, count + 1) / (2 * math.pi)
    assert frequencies_hz[count - 1] < 20_000 <= frequencies_hz[count]


@pytest.mark.parametrize("field", ["length_m", "tension_n", "density_kg_m3"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_impossible_parameters_are_named(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=field):
        StringParameters(**{field: value})


def test_overdamped_modes_are_named() -> None:
    with pytest.raises(ValueError, match="mode 1 is overdamped"):
        resonator_of(StringParameters(damping_d1_kg_m_s=10.0), 3).eigenvalues()
