"""The seam: batches of resonators, and one that is no string.

A rectangular membrane whose tension is the same everywhere (Berger's assumption) is a third kind of resonator: its
modes are products of sines, and its stretch acts on all of them as a string's does. Truth and models take it so.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from engine.models import build_model
from engine.models.base import Physics
from engine.resonators import Resonator
from engine.resonators.string import resonator_of
from engine.truth import ModalState, SplittingSolver, solve_dop853
from engine.values.string import StringParameters
from tests.engine.sounds import relative
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


def grid(drum: Resonator, amplitudes: torch.Tensor) -> torch.Tensor:
    return torch.from_numpy(drum.to_grid(amplitudes.numpy()))


def error(model: Any, drum: Resonator, how: str, steps: int) -> float:
    """Of a model that starts so, against the truth."""
    model.initialise(how, Physics(drum, RATE_HZ, 1e-3), torch.Generator().manual_seed(0))
    state = struck(drum)
    with torch.no_grad():
        found = model.double().eval()(grid(drum, state.amplitude) / 1e-3, steps) * 1e-3
    truth = grid(drum, SplittingSolver(drum, RATE_HZ).solve(state, steps)[:, 1:])
    return relative(found.to(truth).numpy(), truth.numpy())


def test_a_linear_membrane_is_its_closed_form_and_its_grid_holds_its_modes() -> None:
    drum = membrane()
    state = struck(drum)
    amplitudes = np.random.default_rng(0).normal(size=(4, drum.modes))
    np.testing.assert_allclose(drum.to_modes(drum.to_grid(amplitudes)), amplitudes, rtol=1e-7, atol=1e-12)
    found = SplittingSolver(drum, RATE_HZ).solve(state, 4000)
    times_s = torch.arange(4001, dtype=torch.float64)[:, None] / RATE_HZ
    omega, sigma = torch.from_numpy(drum.omega), torch.from_numpy(drum.sigma)
    turning = (omega.square() - sigma.square()).sqrt()
    swing = torch.cos(turning * times_s) + sigma / turning * torch.sin(turning * times_s)
    expected = state.amplitude[:, None] * torch.exp(-sigma * times_s) * swing
    assert relative(found.numpy(), expected.numpy()) < 1e-12
    assert relative(solve_linear(drum, state, times_s[:, 0]).numpy(), expected.numpy()) < 1e-12


def test_a_membrane_that_stiffens_is_the_oracles() -> None:
    drum = membrane(stiffening=3e7)
    state = struck(drum)
    assert 0.05 < float(drum.relative_tension_rise(state.amplitude.numpy())[0]) < 2
    found = SplittingSolver(drum, RATE_HZ).solve(state, 200).numpy()
    assert relative(found, solve_dop853(drum, state, RATE_HZ, 200).numpy()) < 1e-6
    assert relative(SplittingSolver(membrane(), RATE_HZ).solve(state, 200).numpy(), found) > 0.01  # it does stiffen


@pytest.mark.parametrize(
    ("name", "sizes", "how"),
    [
        ("dmd", {"rank": 18}, "physics"),
        ("lru", {"state_size": 16, "layers": 1}, "physics"),
        ("koopman_integrated", {"state_size": 9}, "averaging"),
    ],
)
def test_a_model_starts_as_a_linear_membrane(name: str, sizes: dict[str, int], how: str) -> None:
    drum = membrane()
    model = build_model(name, {"grid_points": drum.points, **sizes})
    assert error(model, drum, how, 800) < 0.05  # a release from rest, to about σ/ω


def test_averaging_follows_the_stiffening_of_a_membrane() -> None:
    drum = membrane(stiffening=1e7)
    model = build_model("koopman_integrated", {"grid_points": drum.points, "state_size": 9})
    assert error(model, drum, "averaging", 1600) < 0.1 * error(model, drum, "physics", 1600)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"coupling": np.zeros(4)}, "coupling has the shape"),
        ({"sigma": np.full(5, math.nan)}, "sigma holds a number that is not finite"),
        ({"omega": np.arange(5.0, 0.0, -1.0)}, "omega must not fall"),
    ],
)
def test_what_does_not_go_together_is_refused(changed: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        replace(resonator_of(StringParameters(), 5, grid_points=9), **changed)
