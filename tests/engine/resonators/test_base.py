"""The seam: batches of resonators, and one that is no string.

A rectangular membrane whose tension is the same everywhere (Berger's assumption) is a third kind of resonator: its
modes are products of sines, and its stretch acts on all of them as a string's does. Truth and models take it so.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from engine.models import build_model
from engine.models.base import Physics
from engine.resonators import Resonator
from engine.resonators.string import resonator_of
from engine.truth import ModalState, SplittingSolver, solve_dop853
from engine.values.string import StringParameters
from tests.engine.tensors import solve_linear

SIDES_M = (0.30, 0.22)
POINTS = (9, 7)  # of the grid, edges included
ORDERS = [(m, n) for m in range(1, 4) for n in range(1, 4)]
RATE_HZ = 8_000


def membrane(stiffening: float = 0.0) -> Resonator:
    """Waves of 60 m/s on a rectangle that is held at its edges, all of it damped alike."""
    eta = [math.pi * math.hypot(m / SIDES_M[0], n / SIDES_M[1]) for m, n in ORDERS]
    order = sorted(range(len(eta)), key=eta.__getitem__)
    stretch = np.array([eta[i] ** 2 for i in order])
    x, y = (np.linspace(0, 1, points) for points in POINTS)
    shapes = np.stack(
        [
            (np.sin(math.pi * m * x)[:, None] * np.sin(math.pi * n * y)).flatten()
            for m, n in (ORDERS[i] for i in order)
        ]
    )
    return Resonator(
        omega=60.0 * np.sqrt(stretch),
        sigma=np.full_like(stretch, 8.0),
        coupling=stiffening * stretch,
        stretch=stretch,
        tension_rise=stiffening / 60.0**2,
        shapes=shapes,
        analysis=shapes.T * (4 / ((POINTS[0] - 1) * (POINTS[1] - 1))),
    )


def struck(drum: Resonator) -> ModalState:
    """Pulled off its middle, a millimetre high, and released."""
    x, y = (np.linspace(0, 1, points) for points in POINTS)
    bump = np.exp(-40 * ((x - 0.4)[:, None] ** 2 + (y - 0.3) ** 2)).flatten()
    return ModalState.at_rest(torch.from_numpy(1e-3 * drum.to_modes(bump)[None]))


def relative(found: torch.Tensor, truth: torch.Tensor) -> float:
    return float((found - truth).norm() / truth.norm())


def test_a_membranes_grid_holds_its_modes() -> None:
    drum = membrane()
    amplitudes = np.random.default_rng(0).normal(size=(4, drum.modes))
    np.testing.assert_allclose(drum.to_modes(drum.to_grid(amplitudes)), amplitudes, rtol=1e-7, atol=1e-12)


def test_the_truth_of_a_linear_membrane_is_its_closed_form() -> None:
    drum = membrane()
    state = struck(drum)
    found = SplittingSolver(drum, RATE_HZ).solve(state, 4000)
    times_s = torch.arange(4001, dtype=torch.float64)[:, None] / RATE_HZ
    omega, sigma = torch.from_numpy(drum.omega), torch.from_numpy(drum.sigma)
    turning = (omega.square() - sigma.square()).sqrt()
    fading = torch.exp(-sigma * times_s)
    swing = torch.cos(turning * times_s) + sigma / turning * torch.sin(turning * times_s)
    assert relative(found, state.amplitude[:, None] * fading * swing) < 1e-12
    assert relative(solve_linear(drum, state, times_s[:, 0]), found) < 1e-12


def test_the_truth_of_a_membrane_that_stiffens_is_the_oracles() -> None:
    drum = membrane(stiffening=3e7)
    state = struck(drum)
    assert 0.05 < float(drum.relative_tension_rise(state.amplitude.numpy())[0]) < 2
    found = SplittingSolver(drum, RATE_HZ).solve(state, 400)
    assert relative(found, solve_dop853(drum, state, RATE_HZ, 400)) < 1e-6
    assert relative(SplittingSolver(membrane(), RATE_HZ).solve(state, 400), found) > 0.01  # it does stiffen


@pytest.mark.parametrize("name", ["koopman_integrated", "lru", "dmd"])
def test_a_model_starts_as_a_linear_membrane(name: str) -> None:
    drum = membrane()
    sizes = {"dmd": {"rank": 18}, "lru": {"state_size": 16, "layers": 1}, "koopman_integrated": {"state_size": 9}}[
        name
    ]
    model = build_model(name, {"grid_points": drum.points, **sizes}).double().eval()
    how = "averaging" if name == "koopman_integrated" else "physics"
    model.initialise(how, Physics(drum, RATE_HZ, 1e-3), torch.Generator().manual_seed(0))
    state = struck(drum)
    with torch.no_grad():
        found = model(torch.from_numpy(drum.to_grid(state.amplitude.numpy()) / 1e-3), 800) * 1e-3
    truth = torch.from_numpy(drum.to_grid(SplittingSolver(drum, RATE_HZ).solve(state, 800)[:, 1:].numpy()))
    assert relative(found.to(truth), truth) < 0.05  # a release from rest, to about σ/ω


def test_averaging_follows_the_stiffening_of_a_membrane() -> None:
    drum = membrane(stiffening=1e7)
    state = struck(drum)
    truth = torch.from_numpy(drum.to_grid(SplittingSolver(drum, RATE_HZ).solve(state, 1600)[:, 1:].numpy()))
    errors = {}
    for how in ("physics", "averaging"):
        model = build_model("koopman_integrated", {"grid_points": drum.points, "state_size": 9}).double().eval()
        model.initialise(how, Physics(drum, RATE_HZ, 1e-3), torch.Generator().manual_seed(0))
        with torch.no_grad():
            errors[how] = relative(
                model(torch.from_numpy(drum.to_grid(state.amplitude.numpy()) / 1e-3), 1600) * 1e-3, truth
            )
    assert errors["averaging"] < 0.1 * errors["physics"]


def test_what_does_not_go_together_is_refused() -> None:
    string = resonator_of(StringParameters(), 5, grid_points=9)
    with pytest.raises(ValueError, match="coupling has the shape"):
        replace(string, coupling=np.zeros(4))
    with pytest.raises(ValueError, match="sigma holds a number that is not finite"):
        replace(string, sigma=np.full(5, math.nan))
    with pytest.raises(ValueError, match="omega must not fall"):
        replace(string, omega=string.omega[::-1])
