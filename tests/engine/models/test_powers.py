"""Powers of an eigenvalue over a horizon: the way each model takes, and the error of others in single precision."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch import Tensor

from engine.models import build_model
from engine.models import eigenvalues as stored
from engine.models.ssm import evolve

STEPS = 4000
PHASES = torch.linspace(0.01, 3.1, 400, dtype=torch.float64)
LOG = torch.complex(torch.full_like(PHASES, math.log(0.9995)), PHASES)
SINGLE = LOG.exp().to(torch.complex64)


def largest_error(found: Tensor, log: Tensor) -> float:
    """Relative error of λ⁴⁰⁰⁰, (states,), against extended precision."""
    real, imaginary = (part.numpy().astype(np.longdouble) for part in (log.real, log.imag))
    true = np.exp(STEPS * real) * np.exp(1j * np.remainder(STEPS * imaginary, 2 * np.longdouble(np.pi)))
    return float(np.abs(found.detach().numpy() / true - 1).max())


def by_steps(eigenvalue: Tensor) -> Tensor:
    power = torch.ones_like(eigenvalue)
    for _ in range(STEPS):
        power = power * eigenvalue
    return power


WAYS: dict[str, tuple[Callable[[], Tensor], float, float]] = {  # with the least and the largest error
    "torch.cumprod": (lambda: SINGLE.expand(STEPS, -1).cumprod(0)[-1], 0.0, 1e-6),
    "step by step": (lambda: by_steps(SINGLE), 1e-7, 1e-4),
    "torch.pow": (lambda: SINGLE**STEPS, 1e-4, 1e-1),
    "this project's table": (lambda: stored.powers(LOG, torch.tensor([STEPS]))[0].to(torch.complex64), 0.0, 2e-7),
    "evolve": (lambda: evolve(LOG, torch.ones_like(LOG)[None], STEPS, torch.complex64)[0][-1, 0], 0.0, 2e-7),
}


@pytest.mark.parametrize("way", WAYS)
def test_errors_of_a_power_in_single_precision(way: str) -> None:
    """Of the eigenvalue that each way is given: rounding λ itself is not counted."""
    power, least, most = WAYS[way]
    own = "torch" in way or "step" in way
    error = largest_error(power(), SINGLE.to(torch.complex128).log() if own else LOG)
    print(f"{way}: {error:.0e}")
    assert least <= error <= most


@pytest.mark.parametrize("model", ["dmd", "koopman", "koopman_var"])
def test_koopman_models_take_any_power_from_the_double_precision_table(model: str) -> None:
    made = build_model(model, {"grid_points": 101})
    (log,) = made.log_eigenvalues()
    assert log.dtype == torch.complex128
    origin = torch.ones(1, len(made.powers(torch.tensor([0]))[0]), dtype=torch.complex64)
    latents = made.latents(origin, torch.tensor([STEPS]))[0, 0]
    assert torch.equal(latents, made.powers(torch.tensor([STEPS]))[0].to(torch.complex64))


@pytest.mark.parametrize("model", ["lru", "s5"])
def test_state_space_models_carry_in_double_precision(model: str) -> None:
    made = build_model(model, {"grid_points": 101, "layers": 1})
    state = made.encode(torch.ones(1, 101))
    _, state = made.advance(state, 70)
    assert {latent.dtype for latent in state.latents} == {torch.complex128}
