"""Koopman_var: a linear autoencoder around a diagonal Koopman operator with a state-dependent multiplier.

Source: the paper, §3.1 and Fig. 1. With z₀ = encoder(u₀) ∈ ℂⁿ and λ = exp(-exp(ν_log) + i exp(θ_log)),

    z_k = λᵏ z₀,    û_k = decoder(m(|z_k|²) ⊙ z_k),

where the multiplier m: ℝⁿ → ℂⁿ is an MLP on the squared radii.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from engine.models._dense import Dense
from engine.models._diagonal import (
    LearnedEigenvalues,
    complex_outputs,
    dense,
    dense_layers,
    draw_normal,
    draw_orthogonal,
    linear_string_eigenvalues,
    linear_string_encoder,
    perceptron,
    read_layer,
)
from engine.models.base import Physics
from engine.models.configurations import KoopmanVarConfiguration


class KoopmanVar(LearnedEigenvalues):
    """See the module."""

    def __init__(self, configuration: KoopmanVarConfiguration) -> None:
        super().__init__(configuration)
        n = configuration.state_size
        self.encoder = Dense(configuration.grid_points, 2 * n)
        self.nu_log = nn.Parameter(torch.zeros(n))
        self.theta_log = nn.Parameter(torch.zeros(n))
        # m: |z|² of all latents to a complex factor for each, real parts first
        self.multiplier = perceptron(n, *configuration.multiplier_widths, 2 * n)
        self.decoder = nn.Linear(2 * n, configuration.grid_points)

    def observed(self, latents: Tensor) -> Tensor:
        """The multiplied states m(|z|²) ⊙ z."""
        return latents * complex_outputs(self.multiplier, _squared_radius(latents))

    def states(self, latents: Tensor, origin: Tensor, powers: Tensor) -> Tensor:
        """See the contract; |λᵏ|² |z₀|² costs a training step less than |λᵏz₀|²."""
        radii = _squared_radius(origin)[:, None] * _squared_radius(powers)
        return latents * complex_outputs(self.multiplier, radii)

    def read(self, states: Tensor, readout: Tensor | None = None) -> Tensor:
        return dense(states, *read_layer(self.decoder, readout))

    def set_weights(self, how: str, physics: Physics, generator: torch.Generator) -> None:
        """See the contract.

        paper: eigenvalues uniform in the ring 0.99 ≤ |λ| ≤ 1, orthogonal encoder and decoder.
        physics: the first `modes` latents are the linear string (its eigenvalues, sine transform and inverse);
            the others repeat those frequencies with other decay rates and are not yet heard. A multiplier of 1
            starts it as the linear string. Prior knowledge that the paper's model does not have: say so in a table.
        """
        n = self.configuration.state_size
        draw_normal(dense_layers(self.multiplier), generator)
        draw_orthogonal((self.encoder, self.decoder), generator)
        if how == "paper":
            self.draw_eigenvalues(generator)
            return
        self.store_eigenvalues(linear_string_eigenvalues(n, physics, generator))
        self.encoder.weight.copy_(linear_string_encoder(n, physics))
        self.decoder.weight.mul_(0.01)
        self.decoder.weight[:, :n] = 0
        self.decoder.weight[:, : physics.modes] = physics.shapes
        last = dense_layers(self.multiplier)[-1]
        last.weight.mul_(0.01)
        last.bias[:n] = 1


def _squared_radius(latents: Tensor) -> Tensor:
    """|z|² of each latent, real, in the shape of `latents`."""
    return latents.real.square() + latents.imag.square()
