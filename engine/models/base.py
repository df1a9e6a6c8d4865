"""The contract of every learned string.

A displacement is *encoded* to a state; the state is *advanced* by one sample or more, which yields the
displacement of each; what comes out is *decoded* on the grid, or only at listening points. The state is a
value: blocks chain, and nothing is remembered behind the caller's back.

Models work in the preset's normalised units (displacement divided by its scale) and at the sample rate that
they were trained at. Adding a model: its configuration in `configurations.py`, one file with its state and a
final subclass of `StringModel`, and one line in `engine/models/__init__.py`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, Protocol, TypeVar, runtime_checkable

import torch
from torch import Tensor, nn

from engine import bounds
from engine.resonators.base import Resonator

State = TypeVar("State")
LINEAR_STRING = "the modes of the string at rest"  # given to a start "physics"


@dataclass(frozen=True)
class Physics:
    """The knowledge that an initialisation may have of the resonator whose motion a model shall learn.

    Attributes:
        scale_m: the model's unit of displacement.
    """

    resonator: Resonator
    rate_hz: float
    scale_m: float = 1.0

    @property
    def modes(self) -> int:
        return self.resonator.modes

    @property
    def log_eigenvalues(self) -> Tensor:
        """log λ = (-σ + iω_d) / rate at rest, complex128 (modes,)."""
        return torch.from_numpy(self.resonator.eigenvalues() / self.rate_hz)

    @property
    def analysis(self) -> Tensor:
        """(modes, grid_points): analysis @ displacement = amplitudes."""
        return torch.from_numpy(self.resonator.inverse).T

    @property
    def shapes(self) -> Tensor:
        """(grid_points, modes): shapes @ amplitudes = displacement."""
        return torch.from_numpy(self.resonator.shapes).T


@dataclass(frozen=True)
class StringModes:
    """The modes of an unknown string as its motions show them, in normalised units, float64; times are in samples.

    Where they come from is the caller's: `training.fitting.phases` finds them in displacement alone.

    A mode n that starts at rest at q moves as q Re s exp[(log λ) t + i Σ_m κ_nm ∫ E_m]. Here E_m(t) is the square of
    mode m's start, decaying twice as fast as its motion.

    Attributes:
        shapes: (modes, grid_points), linearly independent.
        log_eigenvalues: log λ = -σ + iω, complex128 (modes,).
        starts: s, complex128 (modes,).
        coupling: κ, rad/sample, (modes, modes).
        squares: q² of typical strings, (strings, modes).
    """

    shapes: Tensor
    log_eigenvalues: Tensor
    starts: Tensor
    coupling: Tensor
    squares: Tensor

    @property
    def analysis(self) -> Tensor:
        """(modes, grid_points): of a displacement, each mode's amplitude."""
        return torch.linalg.pinv(self.shapes).T

    @property
    def drift(self) -> Tensor:
        """The typical rise of each mode's frequency, Σ_m κ_nm q_m² in rad/sample, (modes,): a mean over strings."""
        return self.coupling @ self.squares.mean(0)


class StringModel(nn.Module, ABC, Generic[State]):
    """A learned map from an initial displacement to the motion that follows.

    Args:
        configuration: a frozen dataclass of sizes, `grid_points` among them.
    """

    # by name what a start receives of the resonator, in words; empty: nothing. The first is the source's own.
    initialisations: ClassVar[Mapping[str, str]]
    # names of parameters, or of their last parts, that a recipe gives a rate of their own
    eigenvalue_parameters: ClassVar[frozenset[str]] = frozenset()
    coupling_parameters: ClassVar[frozenset[str]] = frozenset()
    # whether `sample` takes much less time than `advance`; `koopman_tension` steps, but leaves most shapes out
    any_frame: ClassVar[bool] = False
    mapped: ClassVar[bool] = True  # whether `torch.func.vmap` can map copies of it in training

    def __init__(self, configuration: Any) -> None:
        super().__init__()
        self.configuration = configuration
        self.grid_points: int = configuration.grid_points

    @classmethod
    def own_initialisation(cls) -> str:
        """The one of the model's source."""
        return next(iter(cls.initialisations))

    @torch.no_grad()
    def initialise(self, how: str, physics: Physics, generator: torch.Generator) -> None:
        """Set every weight in place; `how` is one of `initialisations` and is recorded in the preset.

        Raises:
            ValueError: an unknown `how`, or one that these sizes do not allow.
        """
        bounds.check_choice("initialisation", how, self.initialisations)
        self.set_weights(how, physics, generator)

    @abstractmethod
    def set_weights(self, how: str, physics: Physics, generator: torch.Generator) -> None:
        """Set every weight as a start of the model does: `initialise`, which has checked `how`, without gradients."""

    @abstractmethod
    def encode(self, displacement: Tensor) -> State:
        """The state at frame 0 of strings that are released at rest from displacements (batch, grid_points).

        Displacement alone gives no phase but that of a string at rest (the paper, §4.1 and its conclusion).
        """

    @abstractmethod
    def advance(self, state: State, steps: int, readout: Tensor | None = None) -> tuple[Tensor, State]:
        """The next `steps` frames and the state after them.

        Args:
            readout: (grid_points, points) linear map applied to every frame, for example
                `sine_transform.listening_weights`; None decodes on the whole grid. Fewer points cost less.

        Returns:
            displacement (batch, steps, points or grid_points) in normalised units and the model's own precision,
            and the last state.
        """

    def sample(self, state: State, frames: Tensor, steps: int) -> tuple[Tensor, State]:
        """Sample the motion on the grid, as `advance`, keeping some frames: `any_frame` models compute no others.

        Args:
            frames: their numbers, ascending, of 1 … steps; int64 (frames,).

        Returns:
            displacement (batch, frames, grid_points), and the state after all `steps`.
        """
        motion, after = self.advance(state, steps)
        return motion[:, frames - 1], after

    @torch.no_grad()
    def log_eigenvalues(self) -> list[Tensor]:
        """The learned frequencies and decays: log λ a sample, complex128, a tensor each layer.

        Both of a conjugate pair where a layer has them. Empty where nothing of a model moves by itself.
        """
        return []

    def forward(self, displacement: Tensor, steps: int, readout: Tensor | None = None) -> Tensor:
        """Frames 1 … steps after a release from `displacement` (batch, grid_points): (batch, steps, points)."""
        return self.advance(self.encode(displacement), steps, readout)[0]


@runtime_checkable
class KoopmanModel(Protocol):
    """A model whose latents z can be had at any frame: from z(0), (batch, n), to z, (batch, frames, n)."""

    def encode(self, displacement: Tensor) -> Any: ...
    def latents(self, origin: Tensor, frames: Tensor) -> Tensor: ...
    def decode(self, latents: Tensor) -> Tensor: ...


def count_parameters(model: nn.Module) -> int:
    """Trainable numbers, a complex one counted as two."""
    return sum(p.numel() * (2 if p.is_complex() else 1) for p in model.parameters() if p.requires_grad)
