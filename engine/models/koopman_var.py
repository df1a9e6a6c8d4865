"""Koopman_var: a linear autoencoder around a diagonal Koopman operator with a state-dependent multiplier.

Source: the paper, §3.1 and Fig. 1. With z₀ = encoder(u₀) ∈ ℂⁿ and λ = exp(-exp(ν_log) + i exp(θ_log)),

    z_k = λᵏ z₀,    û_k = decoder(m(|z_k|²) ⊙ z_k),

where the multiplier m: ℝⁿ → ℂⁿ is an MLP on the squared radii.

The radii decay without oscillating, so m changes slowly in time, and a long render computes it at few frames and
interpolates. Not on an even grid: SELU bends at 0, and each unit that crosses 0 leaves a bend in m at a time that
cannot be known before. Intervals are therefore halved until a line through their ends passes the middle closely.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from engine.models._dense import Dense
from engine.models._diagonal import (
    FRAMES_AT_ONCE,
    SEGMENT,
    KoopmanState,
    LearnedEigenvalues,
    dense,
    dense_layers,
    energy,
    initialise_orthogonal,
    linear_string_eigenvalues,
    linear_string_encoder,
    perceptron,
    read_layer,
    store_eigenvalues,
    store_ring,
)
from engine.models.base import Physics, check_initialisation
from engine.models.configurations import KoopmanVarConfiguration
from engine.models.eigenvalues import pack

LONG = 4 * FRAMES_AT_ONCE  # frames, times the batch, of a block with interpolated multipliers: they hold few latents
SHORT = 512  # frames of a block of which every multiplier is computed: to look for fewer takes as long


class KoopmanVar(LearnedEigenvalues):
    """See the module.

    Attributes:
        multiplier_tolerance: a setting of rendering, no part of a preset: how far an interpolated multiplier may
            lie from the computed one, at the middle of its interval, as a share of the latents' norm there. 0
            computes every frame, as training does. The default leaves the displacement within 1e-5 of its peak.
    """

    def __init__(self, configuration: KoopmanVarConfiguration) -> None:
        super().__init__()
        self.configuration = configuration
        self.grid_points = configuration.grid_points
        self.multiplier_tolerance = 1e-5
        n = configuration.state_size
        self.encoder = Dense(configuration.grid_points, 2 * n)
        self.nu_log = nn.Parameter(torch.zeros(n))
        self.theta_log = nn.Parameter(torch.zeros(n))
        self.multiplier = perceptron(n, *configuration.multiplier_widths, 2 * n)
        self.decoder = nn.Linear(2 * n, configuration.grid_points)

    def encode(self, displacement: Tensor) -> KoopmanState:
        return KoopmanState(pack(self.encoder(displacement)), 0)

    def decode(self, latents: Tensor, readout: Tensor | None = None) -> Tensor:
        return dense(latents * self._multipliers(latents), *read_layer(self.decoder, readout))

    def render(self, origin: Tensor, first: int, count: int, readout: Tensor | None) -> Tensor:
        if not self._interpolates() or count <= SHORT:
            return self.decode(self.successive_latents(origin, first, count), readout)
        start, stop = first // SEGMENT * SEGMENT, -(-(first + count) // SEGMENT) * SEGMENT
        frames = self._render_interpolated(origin, start, stop, readout)
        return frames[:, first - start : first - start + count]

    def _interpolates(self) -> bool:
        return not self.training and self.multiplier_tolerance > 0

    def _frames_at_once(self, batch: int) -> int:
        return max(FRAMES_AT_ONCE, LONG // batch) if self._interpolates() and batch else FRAMES_AT_ONCE

    def _multipliers(self, latents: Tensor) -> Tensor:
        """m(|z|²), complex (..., state_size)."""
        return pack(self.multiplier(latents.real.square() + latents.imag.square()))

    def _render_interpolated(self, origin: Tensor, start: int, stop: int, readout: Tensor | None) -> Tensor:
        """Frames start … stop - 1, both multiples of SEGMENT, with the multiplier linear between nodes.

        Nodes are halvings of [start, stop] in absolute frame numbers, so that it hardly matters to a frame (within
        the tolerance) in which block it is rendered. Within an interval the decoder is turned by λʲ instead of the
        latents: for all intervals of one width that is a single matrix product.
        """
        weight, bias = read_layer(self.decoder, readout)
        out = weight.new_empty(len(origin), stop - start, len(bias))
        turn = self.powers(torch.arange(SEGMENT, device=origin.device)).to(origin.dtype)
        # Re(w̄ λʲ z) = Re(conj(w λ̄ʲ) z): (SEGMENT, points, state_size)
        turned = torch.view_as_real(pack(weight) * turn.conj()[:, None]).flatten(-2)

        def fill(left: Tensor, width: int, z: Tensor, m_left: Tensor, m_right: Tensor) -> None:
            ends = torch.view_as_real(torch.stack([z * m_left, z * m_right])).flatten(-2)
            at_ends = (ends @ turned[:width].flatten(0, 1).T).unflatten(-1, (width, len(bias)))
            offset = torch.arange(width, device=left.device)
            share = (offset / width).to(weight.dtype)[:, None]
            out[:, (left[:, None] - start + offset).flatten()] = (
                torch.lerp(at_ends[0], at_ends[1], share).flatten(1, 2) + bias
            )

        width = SEGMENT
        left = torch.arange(start, stop + 1, width, device=origin.device)
        z = self.coarse_latents(origin, left)
        m = self._multipliers(z)
        left, z, m_left, m_right = left[:-1], z[:, :-1], m[:, :-1], m[:, 1:]
        while width > 1 and len(left):
            width //= 2
            middle, z_middle = left + width, z * turn[width]
            m_middle = self._multipliers(z_middle)
            bend = z_middle * (m_middle - 0.5 * (m_left + m_right))
            bent = (energy(bend) > self.multiplier_tolerance**2 * energy(z_middle * m_middle)).any(0)
            done, todo = (~bent).nonzero()[:, 0], bent.nonzero()[:, 0]
            fill(left[done], width, z[:, done], m_left[:, done], m_middle[:, done])
            fill(middle[done], width, z_middle[:, done], m_middle[:, done], m_right[:, done])
            left = torch.cat([left[todo], middle[todo]])
            z = torch.cat([z[:, todo], z_middle[:, todo]], dim=1)
            m_left, m_right = (
                torch.cat([m_left[:, todo], m_middle[:, todo]], dim=1),
                torch.cat([m_middle[:, todo], m_right[:, todo]], dim=1),
            )
        fill(left, width, z, m_left, m_right)
        return out

    def initialise(self, how: str, physics: Physics, generator: torch.Generator) -> None:
        """See the contract.

        paper: eigenvalues uniform in the ring 0.99 ≤ |λ| ≤ 1, orthogonal encoder and decoder.
        physics: the first `modes` latents are the linear string (its eigenvalues, sine transform and inverse);
            the others repeat those frequencies with other decay rates and are not yet heard. A multiplier of 1
            starts it as the linear string. Prior knowledge that the paper's model does not have: say so in a table.
        """
        check_initialisation(self, how)
        with torch.no_grad():
            for layer in dense_layers(self.multiplier):
                std = layer.in_features**-0.5
                nn.init.trunc_normal_(layer.weight, std=std, a=-2 * std, b=2 * std, generator=generator)
                nn.init.zeros_(layer.bias)
            for layer in (self.encoder, self.decoder):
                initialise_orthogonal(layer, generator)
            if how == "paper":
                store_ring(self.nu_log, self.theta_log, generator)
            else:
                self._initialise_linear_string(physics, generator)

    def _initialise_linear_string(self, physics: Physics, generator: torch.Generator) -> None:
        n, modes = self.configuration.state_size, physics.modes
        log_eigenvalues = linear_string_eigenvalues(n, physics, generator)
        store_eigenvalues(self.nu_log, self.theta_log, log_eigenvalues)
        analysis = torch.from_numpy(physics.resonator.inverse).T[torch.arange(n) % modes]
        self.encoder.weight.copy_(linear_string_encoder(analysis))
        self.decoder.weight.mul_(0.01)
        self.decoder.weight[:, :n] = 0
        self.decoder.weight[:, :modes] = torch.from_numpy(physics.resonator.shapes).T
        last = dense_layers(self.multiplier)[-1]
        last.weight.mul_(0.01)
        last.bias[:n] = 1
