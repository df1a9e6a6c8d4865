"""The string's closed forms, losses by mode, and transform, which is exact on the grid."""

import math
from dataclasses import replace

import numpy as np
import pytest

from engine.resonators.losses import loss_rates
from engine.resonators.sine_transform import (
    LARGEST_KEPT,
    listening_weights,
    mode_shapes,
    synthesis_matrix,
    to_grid,
    to_modes,
)
from engine.resonators.string import decay_rates, resonator_of, undamped_frequencies, wavenumbers
from engine.values.string import Losses, StringParameters

STRING = StringParameters()
STEEL = StringParameters(0.65, 5e-7, 2e-14, 7850.0, 2e11, 0.0, 0.0, 75.0)


def test_it_is_the_papers_b3_and_harmonic_without_stiffness_and_solves_its_equation():
    assert undamped_frequencies(STRING, 1)[0] / (2 * math.pi) == pytest.approx(246.94, abs=0.5)
    frequencies = undamped_frequencies(StringParameters(second_moment_m4=0), 5)
    np.testing.assert_allclose(frequencies / frequencies[0], np.arange(1, 6))
    s = resonator_of(STRING, 25).eigenvalues()
    residual = s**2 + 2 * decay_rates(STRING, 25) * s + undamped_frequencies(STRING, 25) ** 2
    assert float((np.abs(residual) / np.abs(s) ** 2).max()) < 1e-14


def test_relative_tension_rise_is_the_stretch_of_the_shape():
    """EA/2ℓ ∫ y'² dx / T₀ by quadrature of a shape with three modes."""
    amplitudes, eta = np.array([3e-3, -1e-3, 2e-3]), wavenumbers(STRING, 3)
    x = np.linspace(0, STRING.length_m, 20_001)
    slope = (amplitudes * eta * np.cos(eta * x[:, None])).sum(1)
    stretch = float(np.trapezoid(slope**2, x))
    expected = STRING.youngs_modulus_pa * STRING.area_m2 / (2 * STRING.length_m) * stretch / STRING.tension_n
    assert float(resonator_of(STRING, 3).relative_tension_rise(amplitudes)) == pytest.approx(expected, rel=1e-6)


def test_losses_have_their_limits():
    """Friction gives all partials one quality, bending that of stiff ones; air by hand of a thin string."""
    flexible, stiff = replace(STEEL, youngs_modulus_pa=0.0), replace(STEEL, second_moment_m4=1e-7)
    quality = 2 * loss_rates(Losses(0.0, 1e-3, 0.5), flexible, 20) / undamped_frequencies(flexible, 20)
    np.testing.assert_allclose(quality, 1e-3)
    bent = 2 * loss_rates(Losses(0.0, 0.0, 0.01), stiff, 40)[-1] / undamped_frequencies(stiff, 40)[-1]
    assert bent == pytest.approx(0.01, rel=0.01)
    # 2R = 0.2 mm at 440 Hz, ρA = 2.47e-4 kg/m: σ = π (ν + d √(π ν ρ f)) / ρA
    thin = replace(flexible, area_m2=math.pi * 1e-8)
    thin = replace(thin, tension_n=(2 * 440 * thin.length_m) ** 2 * thin.mass_per_length_kg_m)
    by_hand = math.pi * (1.8e-5 + 2e-4 * math.sqrt(math.pi * 1.8e-5 * 1.2 * 440)) / 2.4662e-4
    assert float(loss_rates(Losses(1.0, 0.0, 0.0), thin, 1)[0]) == pytest.approx(by_hand, rel=1e-3)


@pytest.mark.parametrize(("grid_points", "modes"), [(101, 1), (101, 25), (101, 99), (801, 799), (1_201, 90)])
def test_modes_come_back_from_the_grid_and_a_large_picture_is_that_of_its_table(grid_points, modes):
    amplitudes = np.random.default_rng(1).normal(size=(4, modes))
    displacement = to_grid(amplitudes, grid_points)
    assert (displacement[:, [0, -1]] == 0).all()
    np.testing.assert_allclose(to_modes(displacement, modes), amplitudes, rtol=1e-7, atol=1e-10)
    assert (grid_points * modes > LARGEST_KEPT) == (grid_points > 101)
    np.testing.assert_allclose(to_grid(amplitudes[0], grid_points), displacement[0], atol=1e-11)
    assert np.array_equal(synthesis_matrix(grid_points, modes)[:7], synthesis_matrix(grid_points, min(modes, 7)))
    with pytest.raises(ValueError, match="holds 1 to 99 modes, not 100"):
        to_modes(np.zeros(101), 100)


def test_listening_is_exact_on_the_grid_and_between_its_points():
    displacement = np.zeros(101)
    displacement[37] = 1
    heard = displacement @ listening_weights(np.array([0.37, 0.36]), 101)
    np.testing.assert_allclose(heard, [1.0, 0.0], atol=1e-12, rtol=0)
    amplitudes, place = np.array([1.0, 0.5, -0.25]), np.array([0.4321])
    heard = to_grid(amplitudes, 101) @ listening_weights(place, 101)
    np.testing.assert_allclose(heard, amplitudes @ mode_shapes(place, 3), rtol=1e-12)
