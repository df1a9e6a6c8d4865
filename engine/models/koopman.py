"""Koopman: a nonlinear autoencoder around a diagonal Koopman operator.

Source: the paper, §3.1 and Fig. 1 without the dashed box (after Lusch et al. 2018). With z₀ = φ(u₀) ∈ ℂⁿ and
λ = exp(-exp(ν_log) + i exp(θ_log)),

    z_k = λᵏ z₀,    û_k = φ⁻¹(z_k),

where φ and φ⁻¹ are MLPs.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from engine.models._dense import Dense, linear
from engine.models._diagonal import (
    LearnedEigenvalues,
    dense,
    dense_layers,
    draw_orthogonal,
    linear_string_eigenvalues,
    linear_string_encoder,
    perceptron,
    read_layer,
)
from engine.models.base import Physics
from engine.models.configurations import KoopmanConfiguration

SELU_SLOPE = 1.0507009873554805  # of its straight part, which is what is above 0
HELD_AT = 4.0  # standard deviations of displacement above SELU's bend: most plucks stay above it ("physics")
SHARPEST = 0.05  # "physics": relative rise of a mode's frequency by the strongest plucks
HELD_AT_EXACT = 12.0  # the same for `store_basis`: the strongest plucks stay above it, too
SPARE_WEIGHT = 1e-3  # "physics": size of the decoder's weights for the latents that are to spare


class Koopman(LearnedEigenvalues):
    """See the module."""

    def __init__(self, configuration: KoopmanConfiguration) -> None:
        super().__init__(configuration)
        n = configuration.state_size
        self.encoder = perceptron(configuration.grid_points, *configuration.encoder_widths, 2 * n)
        if configuration.mixing_layer:
            self.encoder.append(Dense(2 * n, 2 * n))
        self.nu_log = nn.Parameter(torch.zeros(n))
        self.theta_log = nn.Parameter(torch.zeros(n))
        self.decoder = perceptron(2 * n, *configuration.decoder_widths, configuration.grid_points)

    def read(self, states: Tensor, readout: Tensor | None = None) -> Tensor:
        """Displacement (..., points) by the decoder of states, complex (..., n); `readout` joins its last layer."""
        first, *others = dense_layers(self.decoder)
        if not others:
            return dense(states, *read_layer(first, readout))
        hidden = dense(states, first.weight, first.bias)
        for layer in others[:-1]:
            hidden = layer(nn.functional.selu(hidden))
        return linear(nn.functional.selu(hidden), *read_layer(others[-1], readout))

    def set_weights(self, how: str, physics: Physics, generator: torch.Generator) -> None:
        """See the contract.

        paper: eigenvalues uniform in the ring 0.99 ≤ |λ| ≤ 1, orthogonal layers.
        physics: the linear string: its eigenvalues, and MLPs that are the sine transform and its inverse as long as
            no unit leaves the straight part of SELU. The other latents repeat the modes with other decay rates and
            frequencies up to `SHARPEST` higher, which a tension-modulated string passes through. They are not
            heard at first. Prior knowledge that the paper's model does not have: say so in a table.
        """
        draw_orthogonal(dense_layers(self), generator)
        if how == "paper":
            self.draw_eigenvalues(generator)
        else:
            self._set_linear_string(physics, generator)

    @torch.no_grad()
    def store_basis(self, log_eigenvalues: Tensor, shapes: Tensor, generator: torch.Generator) -> None:
        """Eigenvalues, and a decoder that is û = Σ_j Re z_j shape_j where SELU is straight.

        Args:
            log_eigenvalues: complex (state_size,).
            shapes: (state_size, grid_points).
        """
        self.store_eigenvalues(log_eigenvalues)
        synthesis = torch.cat([shapes.T, torch.zeros_like(shapes.T)], dim=1)
        _store_linear_map(dense_layers(self.decoder), synthesis, generator, held_at=HELD_AT_EXACT, spare=False)

    def _set_linear_string(self, physics: Physics, generator: torch.Generator) -> None:
        """Write the start "physics" of `set_weights` into eigenvalues, encoder and decoder."""
        c = self.configuration
        sharpest = SHARPEST if physics.resonator.tension_modulated else 0.0
        self.store_eigenvalues(linear_string_eigenvalues(c.state_size, physics, generator, sharpest))
        encoder = dense_layers(self.encoder)
        if c.mixing_layer:
            nn.init.eye_(encoder.pop().weight)
        _store_linear_map(encoder, linear_string_encoder(c.state_size, physics), generator)
        synthesis = torch.zeros(c.grid_points, 2 * c.state_size)
        synthesis[:, : physics.modes] = physics.shapes
        _store_linear_map(dense_layers(self.decoder), synthesis, generator, SPARE_WEIGHT)


def _store_linear_map(
    layers: list[nn.Linear],
    matrix: Tensor,
    generator: torch.Generator,
    others: float = 0.0,
    held_at: float = HELD_AT,
    spare: bool = True,
) -> None:
    """Make dense layers with SELU between `matrix` (outputs, inputs), where no unit leaves SELU's straight part.

    Biases hold every hidden unit at a positive value. The first layer's rows hold what `matrix` reads, in a random
    rotation; the hidden layers after it stay as they were drawn, orthogonal; the last undoes them.

    Args:
        others: size of the last layer's random weights for what `matrix` does not read.
        held_at: the units' value where the input is zero, in standard deviations of displacement.
        spare: whether the first layer's units hold what `matrix` does not read, too; latents that nearly cancel in
            what is read are large in all else.

    Raises:
        ValueError: a hidden layer is too narrow.
    """
    *hidden, last = layers
    matrix = matrix.double()
    through = torch.eye(matrix.shape[1], dtype=torch.float64)  # the linear map so far, (units, inputs)
    silent = torch.zeros(matrix.shape[1], dtype=torch.float64)  # what a layer is given where the input is zero
    for layer in hidden:
        weight = (
            layer.weight.double() / SELU_SLOPE
            if layer is not hidden[0]
            else _reading(layer, matrix, generator, spare)
        )
        layer.weight.copy_(weight)
        layer.bias.copy_(held_at - weight @ silent)
        through = SELU_SLOPE * weight @ through
        silent = torch.full((len(weight),), SELU_SLOPE * held_at, dtype=torch.float64)
    weight = matrix @ torch.linalg.pinv(through)
    if not torch.allclose(weight @ through, matrix, atol=1e-6 * float(matrix.abs().max())):
        narrow = min(layer.out_features for layer in hidden)
        raise ValueError(
            f"initialisation 'physics' needs hidden layers that can hold the string; the narrowest has {narrow} units"
        )
    weight = weight + others * torch.empty_like(weight).normal_(generator=generator)
    last.weight.copy_(weight)
    last.bias.copy_(-weight @ silent)


def _reading(layer: nn.Linear, matrix: Tensor, generator: torch.Generator, spare: bool) -> Tensor:
    """Weights (units, inputs) that hold all that `matrix` reads, and if `spare` what else there is room for."""
    _, values, rows = torch.linalg.svd(matrix, full_matrices=False)
    rows = rows[values > 1e-9 * values[0]]
    units, inputs = layer.weight.shape
    others = torch.empty(inputs, inputs, dtype=torch.float64).normal_(generator=generator)
    basis = torch.linalg.qr(torch.cat([rows, others]).T).Q[:, : min(units, inputs)].T if spare else rows
    turn = nn.init.orthogonal_(torch.empty(units, len(basis), dtype=torch.float64), generator=generator)
    return turn @ basis
