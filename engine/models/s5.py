"""S5: diagonal state-space layers discretised from continuous time, in conjugate pairs.

Source: the paper, §3.2, after Smith et al. 2023; its start as in the paper's own code (rodrigodzf/physmodjax). With
the step Δ = exp(log_step) learned for every state and zero-order hold, λ = exp(ΛΔ) and B̄ = (λ - 1) Λ⁻¹ B. One state
of each conjugate pair is kept; the output is 2 Re(C x). The real part of Λ is not bounded: a trained model may have
|λ| > 1, and then grow.
"""

from __future__ import annotations

import math
from typing import ClassVar

import torch
from torch import Tensor, nn

from engine.models.ssm import DiagonalSSM, SSMString, draw_lecun, scale_rows

# the initial draw of Δ, in the source's arbitrary unit of time; Smith et al. have 1e-3 as the smallest, too
SMALLEST_STEP = {"paper": 1e-4, "physics": 1e-3}
LARGEST_STEP = 0.1


def hippo_normal(size: int) -> tuple[Tensor, Tensor]:
    """The normal part of the HiPPO-LegS matrix, diagonalised: Λ (size,) and V (size, size), complex128.

    HiPPO-LegS is -½ I plus a skew-symmetric matrix plus a matrix of rank one, which is left out (Gu et al. 2022).
    The eigenvalues come in order of their imaginary part, so the first half has one of each conjugate pair.
    """
    root = torch.sqrt(2 * torch.arange(size, dtype=torch.float64) + 1)
    lower = torch.tril(torch.outer(root, root), -1) / 2
    frequency, vectors = torch.linalg.eigh(1j * (lower - lower.T))
    return torch.complex(torch.full_like(frequency, -0.5), frequency), vectors


class S5Layer(DiagonalSSM):
    """An S5 layer with `states` stored states."""

    conjugates: ClassVar = 2

    def __init__(self, states: int, points: int, hippo_blocks: int) -> None:
        super().__init__(states, points)
        self.hippo_blocks = hippo_blocks
        self.Lambda_re = nn.Parameter(torch.full((states,), -0.5))  # of Λ, per the source's unit of time
        self.Lambda_im = nn.Parameter(torch.zeros(states))
        self.log_step = nn.Parameter(torch.zeros(states, 1))  # log Δ: the length of a sample in that unit

    def log_eigenvalues(self) -> Tensor:
        return self._rates() * self.log_step[:, 0].double().exp()

    def input_matrix(self) -> Tensor:
        return scale_rows(self.B, torch.special.expm1(self.log_eigenvalues()) / self._rates())

    def initialise(self, how: str, generator: torch.Generator) -> None:
        """HiPPO-LegS in `hippo_blocks` blocks; B and C are real draws in its coordinates; Δ is log-uniform.

        The paper's code draws C by `lecun_normal` on (outputs, 2P, 2), whose fan-in counts the outputs, too: 2P · H
        with 2P states of both halves. For "physics" it is 2P, and the smallest Δ is another, as in its runs so far.
        """
        states, _, points = self.B.shape
        size = 2 * states // self.hippo_blocks
        rates, vectors = hippo_normal(size)
        rates, vectors = rates[: size // 2], vectors[:, : size // 2]
        self.Lambda_re.copy_(rates.real.repeat(self.hippo_blocks))
        self.Lambda_im.copy_(rates.imag.repeat(self.hippo_blocks))
        everywhere = torch.block_diag(*[vectors] * self.hippo_blocks)  # (2 states, states)
        real_B = draw_lecun((2 * states, points), 2 * states, generator)
        drawn = everywhere.mH @ real_B.to(everywhere)
        self.B.copy_(torch.stack([drawn.real, drawn.imag], dim=1))
        fan_in = 2 * states * (points if how == "paper" else 1)
        pair = draw_lecun((points, 2 * states, 2), fan_in, generator)
        self.C.copy_(torch.view_as_real(torch.view_as_complex(pair) @ everywhere))
        self.D.normal_(generator=generator)
        self.log_step.uniform_(math.log(SMALLEST_STEP[how]), math.log(LARGEST_STEP), generator=generator)

    def set_modes(self, log_eigenvalues: Tensor, input_matrix: Tensor) -> None:
        modes = len(log_eigenvalues)
        rates = log_eigenvalues / self.log_step[:modes, 0].double().exp()
        self.Lambda_re[:modes] = rates.real.to(self.Lambda_re)
        self.Lambda_im[:modes] = rates.imag.to(self.Lambda_im)
        self.B[:modes] = scale_rows(input_matrix, rates / torch.special.expm1(log_eigenvalues)).to(self.B)

    def _rates(self) -> Tensor:
        """Λ, complex128 (states,)."""
        return torch.complex(self.Lambda_re.double(), self.Lambda_im.double())


class S5(SSMString):
    """See the module."""

    eigenvalue_parameters: ClassVar = frozenset({"Lambda_re", "Lambda_im", "log_step"})

    def build_layer(self) -> S5Layer:
        c = self.configuration
        return S5Layer(c.state_size // 2, c.grid_points, c.hippo_blocks)
