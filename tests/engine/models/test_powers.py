"""Powers of an eigenvalue over a horizon: errors of the ways to them in single precision."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch import Tensor

from engine.models import eigenvalues as stored
from engine.models.ssm import evolve

STEPS = 4000
PHASES = torch.linspace(0.01, 3.1, 400, dtype=torch.float64)
LOG = torch.complex(torch.full_like(PHASES, math.log(0.9995)), PHASES)
SINGLE = LOG.exp().to(torch.complex64)


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
    """Relative, of λ⁴⁰⁰⁰ of the eigenvalue that a way is given, against extended precision."""
    power, least, most = WAYS[way]
    log = SINGLE.to(torch.complex128).log() if "torch" in way or "step" in way else LOG
    real, imaginary = (part.numpy().astype(np.longdouble) for part in (log.real, log.imag))
    true = np.exp(STEPS * real) * np.exp(1j * np.remainder(STEPS * imaginary, 2 * np.longdouble(np.pi)))
    error = float(np.abs(power().numpy() / true - 1).max())
    print(f"{way}: {error:.0e}")
    assert least <= error <= most
