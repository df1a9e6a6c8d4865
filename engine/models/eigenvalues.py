"""Diagonal linear dynamics: eigenvalues λ = exp(-exp(ν_log) + i exp(θ_log)) and their powers.

Source: the paper, §3.1 (after Orvieto et al. 2023). Every real parameter gives |λ| < 1. Powers are taken as
exp(k log λ) for any k, in any order, without recursion; kθ reaches millions of radians and is reduced modulo 2π
in float64.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from engine.models._tension_law import SLOWEST_LOG

STORED = frozenset({"nu_log", "theta_log"})  # the names of parameters that hold ν_log and θ_log


class StoredEigenvalues:
    """A module with its eigenvalues in two parameters (n,)."""

    nu_log: nn.Parameter
    theta_log: nn.Parameter

    def eigenvalue_logs(self) -> Tensor:
        """log λ = -exp(ν_log) + i exp(θ_log), complex128 (n,)."""
        return torch.complex(-self.nu_log.double().exp(), self.theta_log.double().exp())

    def store_eigenvalues(self, log_eigenvalues: Tensor) -> None:
        """Store the first log λ, complex (n or fewer,); a mode without losses has SLOWEST_LOG."""
        count = len(log_eigenvalues)
        self.nu_log[:count] = (-log_eigenvalues.real).log().clamp(min=SLOWEST_LOG)
        self.theta_log[:count] = log_eigenvalues.imag.log()

    def draw_eigenvalues(self, generator: torch.Generator) -> Tensor:
        """Draw them uniform in the ring 0.99 ≤ |λ| ≤ 1 (the paper, §4.2), and return ν_log in float64."""
        u = torch.rand(2, len(self.nu_log), generator=generator, dtype=torch.float64)
        radius_squared = 0.99**2 + u[0] * (1 - 0.99**2)
        nu_log = torch.log(-0.5 * torch.log(radius_squared))
        self.nu_log.copy_(nu_log)
        self.theta_log.copy_(torch.log(2 * math.pi * u[1]))
        return nu_log


def powers(log_eigenvalues: Tensor, steps: Tensor) -> Tensor:
    """λᵏ, complex128 (steps, n), of log λ, complex128 (n,), for k in `steps` (steps,): any real times in samples."""
    k = steps.to(torch.float64)[:, None]
    phase = torch.remainder(k * log_eigenvalues.imag, 2 * math.pi)
    return torch.polar(torch.exp(k * log_eigenvalues.real), phase)


def slope_at_rest(log_eigenvalues: Tensor) -> Tensor:
    """The b, float64 (n,), with which q Re[(1 + ib) λᵏ] sets out at rest from q.

    0 = Re[(1 + ib) log λ], so that b = -σ/ω.
    """
    return log_eigenvalues.real / log_eigenvalues.imag
