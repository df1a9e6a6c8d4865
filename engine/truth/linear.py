"""Exact motion of damped, uncoupled modes."""

from __future__ import annotations

import torch
from torch import Tensor

from engine.resonators.base import Resonator
from engine.truth.state import ModalState


def damped_rotation(eigenvalues: Tensor, time_s: Tensor) -> Tensor:
    """The exact flow of q̈ + 2σq̇ + ω²q = 0 over `time_s` (...): float64 (..., 2, 2, modes).

    `eigenvalues`: -σ + i√(ω² - σ²), complex128 (modes,).

    Entry [i, j] maps component j of (amplitude, velocity) to component i.
    """
    t = time_s.to(torch.float64)[..., None]
    sigma, omega = -eigenvalues.real, eigenvalues.imag
    decay, cos, sin = torch.exp(-sigma * t), torch.cos(omega * t), torch.sin(omega * t) / omega
    rows = [
        torch.stack([decay * (cos + sigma * sin), decay * sin], dim=-2),
        torch.stack([-decay * (sigma**2 + omega**2) * sin, decay * (cos - sigma * sin)], dim=-2),
    ]
    return torch.stack(rows, dim=-3)


def solve_linear(resonator: Resonator, state: ModalState, times_s: Tensor) -> Tensor:
    """Modal amplitudes at `times_s` (times,) without any coupling: float64 (batch, times, modes)."""
    flow = damped_rotation(torch.from_numpy(resonator.eigenvalues()), times_s)
    return state.amplitude[:, None] * flow[:, 0, 0] + state.velocity[:, None] * flow[:, 0, 1]
