"""Koopman: a nonlinear autoencoder around a diagonal Koopman operator.

Source: the paper, §3.1 and Fig. 1 without the dashed box (after Lusch et al. 2018). With z₀ = φ(u₀) ∈ ℂⁿ and
λ = exp(-exp(ν_log) + i exp(θ_log)),

    z_k = λᵏ z₀,    û_k = φ⁻¹(z_k),

where φ and φ⁻¹ are MLPs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor, nn

from engine.models import eigenvalues
from engine.models._diagonal import (
    DiagonalModel,
    KoopmanState,
    dense,
    dense_layers,
    initialise_orthogonal,
    linear_string_eigenvalues,
    perceptron,
    read_layer,
    store_eigenvalues,
    store_ring,
)
from engine.models.base import Physics, check_initialisation, check_sizes
from engine.models.eigenvalues import pack
from engine.models.inputs import InputKind, input_size, join_input


@dataclass(frozen=True)
class KoopmanConfiguration:
    """Sizes; the defaults are the paper's (191,077 parameters).

    Attributes:
        state_size: number n of complex eigenvalues.
        encoder_widths, decoder_widths: hidden widths of the MLPs.
        mixing_layer: a dense layer 2n → 2n at the encoder's end, without an activation before it. The paper's text
            does not name it, its number of parameters has it.
        input: what the encoder is told; see `engine.models.inputs`.
    """

    grid_points: int = 101
    state_size: int = 128
    encoder_widths: tuple[int, ...] = (128, 128)
    decoder_widths: tuple[int, ...] = (128, 128)
    mixing_layer: bool = True
    input: InputKind = "displacement"

    def __post_init__(self) -> None:
        check_sizes(self, "grid_points", "state_size", "encoder_widths", "decoder_widths")


class Koopman(DiagonalModel):
    """See the module."""

    initialisations: ClassVar = ("paper", "physics")

    def __init__(self, configuration: KoopmanConfiguration) -> None:
        super().__init__()
        self.configuration = configuration
        self.grid_points = configuration.grid_points
        n = configuration.state_size
        inputs = input_size(configuration.input, configuration.grid_points)
        self.encoder = perceptron(inputs, *configuration.encoder_widths, 2 * n)
        if configuration.mixing_layer:
            self.encoder.append(nn.Linear(2 * n, 2 * n))
        self.nu_log = nn.Parameter(torch.zeros(n))
        self.theta_log = nn.Parameter(torch.zeros(n))
        self.decoder = perceptron(2 * n, *configuration.decoder_widths, configuration.grid_points)

    def encode(self, displacement: Tensor, second: Tensor | None = None) -> KoopmanState:
        return KoopmanState(pack(self.encoder(join_input(self.configuration.input, displacement, second))), 0)

    def powers(self, frames: Tensor) -> Tensor:
        return eigenvalues.powers(self.nu_log, self.theta_log, frames)

    def decode(self, latents: Tensor, readout: Tensor | None = None) -> Tensor:
        first, *others = dense_layers(self.decoder)
        if not others:
            return dense(latents, *read_layer(first, readout))
        hidden = dense(latents, first.weight, first.bias)
        for layer in others[:-1]:
            hidden = layer(nn.functional.selu(hidden))
        return nn.functional.linear(nn.functional.selu(hidden), *read_layer(others[-1], readout))

    def render(self, origin: Tensor, first: int, count: int, readout: Tensor | None) -> Tensor:
        return self.decode(self.successive_latents(origin, first, count), readout)

    def initialise(self, how: str, physics: Physics, generator: torch.Generator) -> None:
        """See the contract.

        paper: eigenvalues uniform in the ring 0.99 ≤ |λ| ≤ 1, orthogonal layers.
        physics: the same layers, and the eigenvalues of the linear string's modes, repeated with other decay rates.
            Prior knowledge that the paper's model does not have: say so in a table.
        """
        check_initialisation(self, how)
        with torch.no_grad():
            for layer in (*dense_layers(self.encoder), *dense_layers(self.decoder)):
                initialise_orthogonal(layer, generator)
            if how == "paper":
                store_ring(self.nu_log, self.theta_log, generator)
            else:
                n = self.configuration.state_size
                store_eigenvalues(self.nu_log, self.theta_log, linear_string_eigenvalues(n, physics, generator))
