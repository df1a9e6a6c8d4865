"""LRU: linear recurrent units with exponentially parametrised eigenvalues.

Source: the paper, §3.2, after Orvieto et al. 2023: λ = exp(-exp(ν_log) + i exp(θ_log)), B̄ = exp(γ_log) B. Stable for
every parameter value.
"""

from __future__ import annotations

from typing import ClassVar

import torch
from torch import Tensor, nn

from engine.models.eigenvalues import STORED, StoredEigenvalues
from engine.models.ssm import DiagonalSSM, SSMString


class LRULayer(StoredEigenvalues, DiagonalSSM):
    """A linear recurrent unit."""

    conjugates: ClassVar = 1

    def __init__(self, states: int, points: int) -> None:
        super().__init__(states, points)
        self.nu_log = nn.Parameter(torch.zeros(states))
        self.theta_log = nn.Parameter(torch.zeros(states))
        self.gamma_log = nn.Parameter(torch.zeros(states))  # log of the factor of each row of B

    def log_eigenvalues(self) -> Tensor:
        return self.eigenvalue_logs()

    def input_matrix(self) -> Tensor:
        return self.B * self.gamma_log.exp()[:, None, None]

    def initialise(self, how: str, generator: torch.Generator) -> None:
        """λ uniform in the ring 0.99 ≤ |λ| ≤ 1; γ keeps the states at unit variance under white noise."""
        nu_log = self.draw_eigenvalues(generator)
        self.gamma_log.copy_(0.5 * torch.log(-torch.expm1(-2 * nu_log.exp())))
        self.B.normal_(std=(2 * self.B.shape[2]) ** -0.5, generator=generator)
        self.C.normal_(std=self.C.shape[1] ** -0.5, generator=generator)
        self.D.normal_(generator=generator)

    def set_modes(self, log_eigenvalues: Tensor, input_matrix: Tensor) -> None:
        modes = len(log_eigenvalues)
        self.store_eigenvalues(log_eigenvalues)
        self.gamma_log[:modes] = 0
        self.B[:modes] = input_matrix.to(self.B)


class LRU(SSMString):
    """See the module."""

    eigenvalue_parameters: ClassVar = STORED

    def build_layer(self) -> LRULayer:
        return LRULayer(self.configuration.state_size, self.grid_points)
