"""The string's closed forms, losses by mode, transform, which is exact on the grid, and two polarisations."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from engine.kernels import strings
from engine.kernels.constants import MOST_PAIRS
from engine.models.base import Physics
from engine.models.koopman_tension import KoopmanTension
from engine.pluck import Pluck
from engine.resonators.base import Resonator
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
from engine.truth import ModalState, SplittingSolver, solve_dop853
from engine.values.string import Losses, Polarisations, StringParameters
from tests.engine.sounds import relative, shipped

STRING = StringParameters()
STEEL = StringParameters(0.65, 5e-7, 2e-14, 7850.0, 2e11, 0.0, 0.0, 75.0)


def test_it_is_the_papers_b3_and_harmonic_without_stiffness_and_solves_its_equation() -> None:
    assert undamped_frequencies(STRING, 1)[0] / (2 * math.pi) == pytest.approx(246.94, abs=0.5)
    frequencies = undamped_frequencies(StringParameters(second_moment_m4=0), 5)
    np.testing.assert_allclose(frequencies / frequencies[0], np.arange(1, 6))
    s = resonator_of(STRING, 25).eigenvalues()
    residual = s**2 + 2 * decay_rates(STRING, 25) * s + undamped_frequencies(STRING, 25) ** 2
    assert float((np.abs(residual) / np.abs(s) ** 2).max()) < 1e-14


def test_relative_tension_rise_is_the_stretch_of_the_shape() -> None:
    """EA/2ℓ ∫ y'² dx / T₀ by quadrature of a shape with three modes."""
    amplitudes, eta = np.array([3e-3, -1e-3, 2e-3]), wavenumbers(STRING, 3)
    x = np.linspace(0, STRING.length_m, 20_001)
    slope = (amplitudes * eta * np.cos(eta * x[:, None])).sum(1)
    stretch = float(np.trapezoid(slope**2, x))
    expected = STRING.youngs_modulus_pa * STRING.area_m2 / (2 * STRING.length_m) * stretch / STRING.tension_n
    assert float(resonator_of(STRING, 3).relative_tension_rise(amplitudes)) == pytest.approx(expected, rel=1e-6)


def test_losses_have_their_limits() -> None:
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


@pytest.mark.parametrize("modes", [1, 25, 99])
def test_modes_come_back_from_the_grid(modes: int) -> None:
    amplitudes = np.random.default_rng(1).normal(size=(4, modes))
    displacement = to_grid(amplitudes, 101)
    assert (displacement[:, [0, -1]] == 0).all()
    np.testing.assert_allclose(to_modes(displacement, modes), amplitudes, rtol=1e-7, atol=1e-12)
    with pytest.raises(ValueError, match="holds 1 to 99 modes, not 100"):
        to_modes(np.zeros(101), 100)


def test_listening_is_exact_on_the_grid_and_between_its_points() -> None:
    displacement = np.zeros(101)
    displacement[37] = 1
    heard = displacement @ listening_weights(np.array([0.37, 0.36]), 101)
    np.testing.assert_allclose(heard, [1.0, 0.0], atol=1e-12, rtol=0)
    amplitudes, place = np.array([1.0, 0.5, -0.25]), np.array([0.4321])
    heard = to_grid(amplitudes, 101) @ listening_weights(place, 101)
    np.testing.assert_allclose(heard, amplitudes @ mode_shapes(place, 3), rtol=1e-12)


@pytest.mark.parametrize(("grid_points", "modes"), [(801, 799), (1_201, 90)])
def test_a_large_picture_is_that_of_its_table(grid_points: int, modes: int) -> None:
    amplitudes = np.random.default_rng(0).normal(size=modes)
    assert grid_points * modes > LARGEST_KEPT
    found, table = to_grid(amplitudes, grid_points), to_grid(amplitudes[None], grid_points)[0]
    np.testing.assert_allclose(found, table, atol=1e-11)
    assert found[0] == found[-1] == 0
    assert np.array_equal(synthesis_matrix(grid_points, modes)[:7], synthesis_matrix(grid_points, 7))


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"coupling": np.zeros(4)}, "coupling has the shape"),
        ({"sigma": np.full(5, math.nan)}, "sigma holds a number that is not finite"),
        ({"omega": np.arange(5.0, 0.0, -1.0)}, "omega must not fall"),
    ],
)
def test_a_resonator_of_what_does_not_go_together_is_refused(changed: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        replace(resonator_of(STRING, 5, grid_points=9), **changed)


MOVING = Polarisations(angle_deg=40, second_heard=0.25, second_cents=2.0, conductance_s_kg=0.02)


def polarised(moving: Polarisations, partials: int) -> Resonator:
    """Pairs of modes, then single ones."""
    law, pairs = resonator_of(STRING, partials), min(MOST_PAIRS, partials)
    modes = range(partials + pairs)
    partial = [strings.partial_of(mode, pairs) - 1 for mode in modes]
    direction = [strings.direction_of(mode, pairs) for mode in modes]
    conductances = moving.conductance_s_kg, moving.second_conductance_s_kg
    rows = np.empty(4 * len(modes))
    strings.rows(STRING.row, len(modes), pairs, moving.detuning, conductances, (0.0, 0.0, 0.0), rows)
    squares, sigma, coupling, stretch = rows.reshape(4, -1)
    pulled, heard = (np.array(each)[direction] for each in (moving.pulled, moving.heard))
    pulled[2 * pairs :] = 1 / moving.heard[0]  # so that it is heard as the others are
    return Resonator(
        omega=np.sqrt(squares),
        sigma=sigma,
        coupling=coupling,
        stretch=stretch,
        tension_rise=law.tension_rise,
        shapes=law.shapes[partial] * heard[:, None],
        analysis=law.analysis[:, partial] * pulled,
    )


def test_both_share_one_tension_in_the_truth_and_in_the_learned_curves() -> None:
    """Against DOP853, at velocities that glide by a quarter-tone; the model as accurate as in one direction.

    A pluck is heard as high as it is pulled.
    """
    pluck, rate_hz, law = Pluck(0.17, 3.0, "rounded", 0.08), 48_000, resonator_of(STRING, 60)
    resonator, wide = polarised(MOVING, 12), polarised(MOVING, 60)
    shape = pluck.displacement(101)
    np.testing.assert_allclose(wide.to_grid(wide.to_modes(shape)), law.to_grid(law.to_modes(shape)), atol=1e-12)
    q = resonator.to_modes(Pluck(0.17, 8.0, "rounded", 0.2).displacement(101))[None]
    assert float(resonator.relative_tension_rise(q[0])) > 0.02
    state = ModalState(q, q[:, ::-1].copy())
    found = SplittingSolver(resonator, rate_hz).solve(state, 1_000)
    assert relative(found, solve_dop853(resonator, state, rate_hz, 1_000)) < 1e-7
    model = shipped("studio_any_string").model
    assert isinstance(model, KoopmanTension)
    heard = wide.shapes @ np.linspace(0, 1, 101)[:, None]
    for amplitude_mm in (1.0, 6.0):
        displacement = pluck.moved(amplitude_mm=amplitude_mm).displacement(101)[None]
        tuned = model.for_resonator(Physics(wide, rate_hz, 1.0))
        moved = tuned.amplitudes(tuned.encode(torch.from_numpy(displacement)), rate_hz // 4).detach().numpy()
        start = ModalState.at_rest(wide.to_modes(displacement))
        true, _ = SplittingSolver(wide, rate_hz).advance(start, rate_hz // 4)
        assert relative(moved @ heard, true @ heard) ** 2 < 1e-6
