"""The base of models with diagonal linear dynamics: z_k = λᵏ z₀, frames decoded from z_k alone.

Any frame can be had in any order. A state keeps z₀ with an integer step instead of z_k: that is what keeps phases
exact after millions of samples and every splitting into blocks the same motion.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar

import torch
from torch import Tensor, nn

from engine.models import eigenvalues
from engine.models._dense import Dense, linear
from engine.models.base import LINEAR_STRING, Physics, StringModel
from engine.models.eigenvalues import StoredEigenvalues

FRAMES_AT_ONCE = 4096  # bounds the memory of a long advance
SEGMENT = 64  # frames of the fine table of powers in `successive_latents`


@dataclass(frozen=True)
class KoopmanState:
    """The encoded initial displacement and the frame reached."""

    origin: Tensor  # complex (batch, state_size)
    step: int


class DiagonalModel(StringModel[KoopmanState]):
    """Advances by powers of the eigenvalues; a subclass encodes, decodes and says what its eigenvalues are."""

    any_frame: ClassVar = True

    @abstractmethod
    def powers(self, frames: Tensor) -> Tensor:
        """λᵏ for k in `frames` (frames,): complex128 (frames, state_size)."""

    @abstractmethod
    def decode(self, latents: Tensor, readout: Tensor | None = None) -> Tensor:
        """Displacement (..., points) of latents (..., state_size)."""

    def advance(self, state: KoopmanState, steps: int, readout: Tensor | None = None) -> tuple[Tensor, KoopmanState]:
        """The next `steps` frames (batch, steps, points), decoded in blocks, and the state after them."""
        first, last = state.step + 1, state.step + steps  # numbers of frames since the release
        blocks = [
            self.decode(self.successive_latents(state.origin, done, min(FRAMES_AT_ONCE, last + 1 - done)), readout)
            for done in range(first, last + 1, FRAMES_AT_ONCE)
        ]
        return torch.cat(blocks, dim=1), KoopmanState(state.origin, last)

    def sample(self, state: KoopmanState, frames: Tensor, steps: int) -> tuple[Tensor, KoopmanState]:
        displacement = self.decode(self.latents(state.origin, state.step + frames))
        return displacement, KoopmanState(state.origin, state.step + steps)

    def latents(self, origin: Tensor, frames: Tensor) -> Tensor:
        """z_k = λᵏ z₀ of any frames (int64, any order), complex (batch, frames, state_size)."""
        return origin[:, None] * self.powers(frames).to(origin.dtype)

    def successive_latents(self, origin: Tensor, first: int, count: int) -> Tensor:
        """z_k of k = first … first + count - 1, complex (batch, count, state_size).

        As products of a coarse table, exact in float64 before it is rounded, and a fine one: one product a frame
        instead of a sine and a cosine.
        """
        starts = self.powers(torch.arange(first, first + count, SEGMENT, device=origin.device))
        coarse = (origin[:, None] * starts).to(origin.dtype)  # every SEGMENT-th frame, (batch, starts, state_size)
        fine = self.powers(torch.arange(min(SEGMENT, count), device=origin.device)).to(origin.dtype)
        return (coarse[:, :, None] * fine).flatten(1, 2)[:, :count]


class LearnedEigenvalues(StoredEigenvalues, DiagonalModel):
    """A diagonal model with its eigenvalues in two parameters; its encoder gives real parts first."""

    initialisations: ClassVar = {"paper": "", "physics": LINEAR_STRING}
    eigenvalue_parameters: ClassVar = eigenvalues.STORED
    encoder: Any  # a dense layer or a perceptron

    def encode(self, displacement: Tensor) -> KoopmanState:
        return KoopmanState(complex_outputs(self.encoder, displacement), 0)

    def powers(self, frames: Tensor) -> Tensor:
        return eigenvalues.powers(self.eigenvalue_logs(), frames)

    def observed(self, latents: Tensor) -> Tensor:
        """The states that the decoder reads, complex like `latents` (..., state_size): the latents themselves."""
        return latents

    def states(self, latents: Tensor, origin: Tensor, powers: Tensor) -> Tensor:
        """The observed states of `latents`, which are z₀ (batch, state_size) times λᵏ (frames, state_size)."""
        return self.observed(latents)

    @abstractmethod
    def read(self, states: Tensor, readout: Tensor | None = None) -> Tensor:
        """Displacement (..., points) of observed states (..., state_size)."""

    def decode(self, latents: Tensor, readout: Tensor | None = None) -> Tensor:
        return self.read(self.observed(latents), readout)

    @torch.no_grad()
    def log_eigenvalues(self) -> list[Tensor]:
        return [self.eigenvalue_logs()]


def dense(latents: Tensor, weight: Tensor, bias: Tensor | None = None) -> Tensor:
    """A dense layer on complex latents (..., n), whose `weight` (out, 2n) has the real parts first.

    The weight's columns are interleaved to match the memory of complex numbers, which costs less than to split
    every latent.
    """
    interleaved = torch.stack(weight.chunk(2, dim=-1), dim=-1).flatten(-2)
    return linear(torch.view_as_real(latents).flatten(-2), interleaved, bias)


def complex_outputs(layer: nn.Linear | nn.Sequential, inputs: Tensor) -> Tensor:
    """A dense layer's outputs, or a perceptron's, whose first half are real parts, as complex (..., n).

    The last weight's rows are interleaved to match the memory of complex numbers.
    """
    *before, last = layer if isinstance(layer, nn.Sequential) else [layer]
    assert isinstance(last, nn.Linear)
    for module in before:
        inputs = module(inputs)
    weight, bias = (torch.stack(both.chunk(2), dim=1).flatten(0, 1) for both in (last.weight, last.bias))
    return torch.view_as_complex(linear(inputs, weight, bias).unflatten(-1, (-1, 2)))


def read_weight(weight: Tensor, readout: Tensor | None) -> Tensor:
    """The weight (grid_points, inputs) of a last layer followed by `readout` (grid_points, points), as one."""
    return weight if readout is None else readout.to(weight).T @ weight


def read_layer(layer: nn.Linear, readout: Tensor | None) -> tuple[Tensor, Tensor]:
    """Weight and bias of a last layer followed by `readout` (grid_points, points), as one layer."""
    return read_weight(layer.weight, readout), read_weight(layer.bias[:, None], readout)[:, 0]


def linear_string_eigenvalues(
    size: int, physics: Physics, generator: torch.Generator, sharpest: float = 0.0
) -> Tensor:
    """log λ, complex128 (size,), of the linear string's modes, repeated in order until `size` are there.

    The repetitions have decay rates up to three times lower or higher, so that no two latents are the same.

    Args:
        sharpest: how far the repetitions are spread above a mode's frequency, as a share of it.

    Raises:
        ValueError: fewer than one for each mode.
    """
    modes = physics.modes
    if size < modes:
        raise ValueError(f"initialisation 'physics' needs a state_size of at least the {modes} modes, not {size}")
    linear = physics.log_eigenvalues[torch.arange(size) % modes]
    # a factor of each decay rate, 1/3 … 3; 1 for the modes themselves
    stretch = 3.0 ** (2 * torch.rand(size, generator=generator, dtype=torch.float64) - 1)
    stretch[:modes] = 1
    repetition = torch.arange(size) // modes
    raised = 1 + sharpest * repetition / max(1, int(repetition[-1]))
    return torch.complex(linear.real * stretch, linear.imag * raised)


def linear_string_encoder(size: int, physics: Physics) -> Tensor:
    """Weights (2 size, grid_points), real parts first, of an encoder whose latents move as Re(λᵏ z₀) = q_k of a mode.

    z₀ = q₀: with the damping that is a string at rest to about σ/ω. (`eigenvalues.slope_at_rest` is what lacks; the
    starts of Koopman and Koopman_var have always left it to the training.)
    """
    analysis = physics.analysis[torch.arange(size) % physics.modes]
    return torch.cat([analysis, torch.zeros_like(analysis)])


def perceptron(*widths: int) -> nn.Sequential:
    """Dense layers of these widths with SELU between."""
    layers: list[nn.Module] = []
    for wide_in, wide_out in pairwise(widths):
        layers += [Dense(wide_in, wide_out), nn.SELU()]
    return nn.Sequential(*layers[:-1])


def dense_layers(model: nn.Module) -> list[nn.Linear]:
    """The dense layers of a model, in order."""
    return [layer for layer in model.modules() if isinstance(layer, nn.Linear)]


def draw_orthogonal(layers: Iterable[nn.Linear], generator: torch.Generator) -> None:
    """Draw orthogonal weights; biases are set to zero."""
    for layer in layers:
        nn.init.orthogonal_(layer.weight, generator=generator)
        nn.init.zeros_(layer.bias)


def draw_normal(layers: Iterable[nn.Linear], generator: torch.Generator) -> None:
    """Draw weights by their fan-in, with no value beyond two standard deviations."""
    for layer in layers:
        std = layer.in_features**-0.5
        nn.init.trunc_normal_(layer.weight, std=std, a=-2 * std, b=2 * std, generator=generator)
        if layer.bias is not None:
            nn.init.zeros_(layer.bias)
