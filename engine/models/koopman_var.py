"""Koopman_var: a linear autoencoder around a diagonal Koopman operator with a state-dependent multiplier.

Source: the paper, §3.1 and Fig. 1. With z₀ = encoder(u₀) ∈ ℂⁿ and λ = exp(-exp(ν_log) + i exp(θ_log)),

    z_k = λᵏ z₀,    û_k = decoder(m(|z_k|²) ⊙ z_k),

where the multiplier m: ℝⁿ → ℂⁿ is an MLP on the squared radii. z_k needs no recursion: any frame can be had in
any order, and the radii decay without oscillating.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import torch
from torch import Tensor, nn

from engine.models import eigenvalues
from engine.models.base import Physics, StringModel, check_initialisation
from engine.models.eigenvalues import pack, unpack
from engine.sine_transform import analysis_matrix, synthesis_matrix

FRAMES_AT_ONCE = 2048  # bounds the memory of a long advance; the result does not depend on it


@dataclass(frozen=True)
class KoopmanVarConfiguration:
    """Sizes; the defaults are the paper's (134,885 parameters).

    Attributes:
        state_size: number n of complex eigenvalues.
        multiplier_widths: hidden widths of the multiplier's MLP.
    """

    grid_points: int = 101
    state_size: int = 128
    multiplier_widths: tuple[int, ...] = (128, 128, 128)

    def __post_init__(self) -> None:
        for name in ("grid_points", "state_size"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, not {getattr(self, name)}")
        if any(width < 1 for width in self.multiplier_widths):
            raise ValueError(f"multiplier_widths must be at least 1, not {self.multiplier_widths}")


@dataclass(frozen=True)
class KoopmanState:
    """The encoded initial displacement and the frame reached.

    Keeping z₀ with an integer step, instead of z_k, is what keeps phases exact after millions of samples and
    every splitting into blocks identical.
    """

    origin: Tensor  # complex (batch, state_size)
    step: int


class KoopmanVar(StringModel[KoopmanState]):
    """See the module."""

    initialisations: ClassVar = ("paper", "physics")

    def __init__(self, configuration: KoopmanVarConfiguration) -> None:
        super().__init__()
        self.configuration = configuration
        self.grid_points = configuration.grid_points
        n = configuration.state_size
        self.encoder = nn.Linear(configuration.grid_points, 2 * n)
        self.nu_log = nn.Parameter(torch.zeros(n))
        self.theta_log = nn.Parameter(torch.zeros(n))
        widths = (n, *configuration.multiplier_widths, 2 * n)
        layers: list[nn.Module] = []
        for wide_in, wide_out in pairwise(widths):
            layers += [nn.Linear(wide_in, wide_out), nn.SELU()]
        self.multiplier = nn.Sequential(*layers[:-1])
        self.decoder = nn.Linear(2 * n, configuration.grid_points)

    def encode(self, displacement: Tensor) -> KoopmanState:
        return KoopmanState(pack(self.encoder(displacement)), 0)

    def advance(self, state: KoopmanState, steps: int, readout: Tensor | None = None) -> tuple[Tensor, KoopmanState]:
        blocks = []
        for done in range(0, steps, FRAMES_AT_ONCE):
            count = min(FRAMES_AT_ONCE, steps - done)
            powers = eigenvalues.successive_powers(self.nu_log, self.theta_log, state.step + 1 + done, count)
            blocks.append(self.decode(state.origin[:, None] * powers.to(state.origin.dtype), readout))
        return torch.cat(blocks, dim=1), KoopmanState(state.origin, state.step + steps)

    def latents(self, origin: Tensor, frames: Tensor) -> Tensor:
        """z_k = λᵏ z₀ of any frames (int64, any order), complex (batch, frames, state_size)."""
        powers = eigenvalues.powers(self.nu_log, self.theta_log, frames)
        return origin[:, None] * powers.to(origin.dtype)

    def decode(self, latents: Tensor, readout: Tensor | None = None) -> Tensor:
        """Displacement (..., points) of latents (..., state_size)."""
        radii = latents.real.square() + latents.imag.square()
        modulated = unpack(latents * pack(self.multiplier(radii)))
        if readout is None:
            return self.decoder(modulated)
        readout = readout.to(modulated)
        return modulated @ (self.decoder.weight.T @ readout) + self.decoder.bias @ readout

    def initialise(self, how: str, physics: Physics, generator: torch.Generator) -> None:
        """See the contract.

        paper: eigenvalues uniform in the ring 0.99 ≤ |λ| ≤ 1, orthogonal encoder and decoder.
        physics: the first `modes` latents are the linear string (its eigenvalues, sine transform and inverse);
            the others repeat those frequencies with other decay rates and are not yet heard. A multiplier of 1
            starts it as the linear string. Prior knowledge that the paper's model does not have: say so in a table.
        """
        check_initialisation(self, how)
        with torch.no_grad():
            for layer in self.multiplier:
                if isinstance(layer, nn.Linear):
                    std = layer.in_features**-0.5
                    nn.init.trunc_normal_(layer.weight, std=std, a=-2 * std, b=2 * std, generator=generator)
                    nn.init.zeros_(layer.bias)
            for layer in (self.encoder, self.decoder):
                nn.init.orthogonal_(layer.weight, generator=generator)
                nn.init.zeros_(layer.bias)
            if how == "paper":
                for stored, drawn in zip(
                    (self.nu_log, self.theta_log),
                    eigenvalues.draw_ring(self.configuration.state_size, generator),
                    strict=True,
                ):
                    stored.copy_(drawn)
            else:
                self._initialise_linear_string(physics, generator)

    def _initialise_linear_string(self, physics: Physics, generator: torch.Generator) -> None:
        n, points, modes = self.configuration.state_size, self.grid_points, physics.modes
        if n < modes:
            raise ValueError(f"initialisation 'physics' needs a state_size of at least the {modes} modes, not {n}")
        mode = torch.arange(n) % modes
        linear = physics.string.eigenvalues(modes)[mode] / physics.rate_hz
        stretch = 3.0 ** (2 * torch.rand(n, generator=generator, dtype=torch.float64) - 1)
        stretch[:modes] = 1
        self.nu_log.copy_(torch.log(-linear.real * stretch))
        self.theta_log.copy_(linear.imag.log())
        self.encoder.weight.zero_()
        self.encoder.weight[:n] = analysis_matrix(points, modes).T[mode].float()
        self.decoder.weight.mul_(0.01)
        self.decoder.weight[:, :n] = 0
        self.decoder.weight[:, :modes] = synthesis_matrix(points, modes).T.float()
        last = self.multiplier[-1]
        assert isinstance(last, nn.Linear)
        last.weight.mul_(0.01)
        last.bias[:n] = 1
