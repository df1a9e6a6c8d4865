"""What can be heard: a preset's model and the physics that it learned, behind one face, in metres.

A source is given initial displacements, yields frames in blocks, and keeps nothing: the state is passed. Rendering,
comparing, the command line and the app treat model and truth alike through it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from engine.models.base import AnyFrameModel
from engine.pluck import FULL_SCALE_M, LEAST_PEAK_M, RUNAWAY_FACTOR
from engine.presets import Preset, PresetInfo
from engine.resonators.sine_transform import to_grid, to_modes
from engine.truth import ModalState, SplittingSolver

SILENCE = 1e-9  # of a mode, of all: what the truth leaves out is 180 dB down


class Runaway(RuntimeError):
    """A model's output stopped being a string's: not finite, or far beyond its initial displacement."""

    def __init__(self, time_s: float) -> None:
        super().__init__(f"the model's output runs away {time_s:.3f} s after the pluck; shorten it or play the truth")
        self.time_s = time_s


@dataclass(frozen=True)
class SourceState:
    """Where a source is: its own state, the frames done, and the largest displacement that is believable."""

    inner: Any
    frame: int
    limit_m: float


class StringSource(ABC):
    """Frames of displacement in m after an initial displacement at rest.

    Attributes:
        any_frame: whether `sample` takes much less time than `advance`, because it leaves the other frames or their
            shapes out.
    """

    rate_hz: int
    grid_points: int
    any_frame: bool

    @abstractmethod
    def start(self, displacement_m: Tensor) -> SourceState:
        """The state at frame 0 for displacements (batch, grid_points), already projected on the modes in use."""

    @abstractmethod
    def advance(self, state: SourceState, steps: int, readout: Tensor | None = None) -> tuple[Tensor, SourceState]:
        """The next frames, (batch, steps, grid_points), or (…, points) where `readout` (grid_points, points) says.

        Raises:
            Runaway: see there.
        """

    @abstractmethod
    def sample(self, state: SourceState, frames: Tensor, steps: int) -> tuple[Tensor, SourceState]:
        """As `advance` on the whole grid, of which only some frames are kept, (batch, frames, grid_points).

        Args:
            frames: their numbers, ascending, of 1 … steps; int64 (frames,).

        Raises:
            Runaway: see there.
        """


class ModelSource(StringSource):
    """A preset's model."""

    def __init__(self, preset: Preset) -> None:
        self._model = preset.model
        self._scale_m = preset.info.scale_m
        self.rate_hz = preset.info.rate_hz
        self.grid_points = preset.info.grid_points
        self.any_frame = isinstance(self._model, AnyFrameModel)

    @torch.inference_mode()
    def start(self, displacement_m: Tensor) -> SourceState:
        _check_grid(displacement_m, self.grid_points)
        displacement = (displacement_m / self._scale_m).float()
        inner = self._model.encode(displacement)
        return SourceState(inner, 0, RUNAWAY_FACTOR * max(float(displacement_m.abs().max()), LEAST_PEAK_M))

    @torch.inference_mode()
    def advance(self, state: SourceState, steps: int, readout: Tensor | None = None) -> tuple[Tensor, SourceState]:
        frames, inner = self._model.advance(state.inner, steps, readout)
        return self._believed(frames, torch.arange(1, steps + 1), state), self._after(state, inner, steps)

    @torch.inference_mode()
    def sample(self, state: SourceState, frames: Tensor, steps: int) -> tuple[Tensor, SourceState]:
        if isinstance(self._model, AnyFrameModel) and len(frames) < steps:
            found, inner = self._model.sample(state.inner, frames, steps)
        else:
            found, inner = self._model.advance(state.inner, steps)
            found = found if len(frames) == steps else found[:, frames - 1]
        return self._believed(found, frames, state), self._after(state, inner, steps)

    def _believed(self, found: Tensor, frames: Tensor, state: SourceState) -> Tensor:
        """In m. Raises Runaway."""
        found = found * self._scale_m
        believable = found.abs() <= state.limit_m  # False for a NaN
        if not bool(believable.all()):
            first = int((~believable).any(dim=2).any(dim=0).nonzero()[0])
            raise Runaway((state.frame + int(frames[first])) / self.rate_hz)
        return found

    @staticmethod
    def _after(state: SourceState, inner: Any, steps: int) -> SourceState:
        return SourceState(inner, state.frame + steps, state.limit_m)


class TruthSource(StringSource):
    """The physics of a preset's string, at the preset's rate and with its modes.

    Args:
        substeps: of the solver (see `SplittingSolver`); None is its default, exact to 1e-7.
    """

    def __init__(self, info: PresetInfo, substeps: int | None = None) -> None:
        self.rate_hz = info.rate_hz
        self.grid_points = info.grid_points
        self.any_frame = True  # it steps through all of them; their shapes are most of the cost
        self._resonator = info.resonator
        self._solver = SplittingSolver(self._resonator, info.rate_hz, substeps=substeps, silence=SILENCE)

    def start(self, displacement_m: Tensor) -> SourceState:
        _check_grid(displacement_m, self.grid_points)
        return SourceState(ModalState.at_rest(self._resonator.to_modes(displacement_m.double())), 0, float("inf"))

    def advance(self, state: SourceState, steps: int, readout: Tensor | None = None) -> tuple[Tensor, SourceState]:
        amplitudes, inner = self._solver.advance(state.inner, steps)
        shapes = self._resonator.shapes
        to_points = shapes if readout is None else shapes @ readout.double()
        return amplitudes @ to_points, SourceState(inner, state.frame + steps, state.limit_m)

    def sample(self, state: SourceState, frames: Tensor, steps: int) -> tuple[Tensor, SourceState]:
        amplitudes, inner = self._solver.sample(state.inner, frames, steps)
        return amplitudes @ self._resonator.shapes, SourceState(inner, state.frame + steps, state.limit_m)


def project(displacement_m: Tensor, modes: int) -> Tensor:
    """Displacement (..., grid_points) without what lies outside the first `modes` modes."""
    return to_grid(to_modes(displacement_m, modes), displacement_m.shape[-1])


def _check_grid(displacement: Tensor, grid_points: int) -> None:
    if displacement.ndim != 2 or displacement.shape[1] != grid_points:
        raise ValueError(
            f"initial displacement must have shape (batch, {grid_points}), not {tuple(displacement.shape)}"
        )


__all__ = [
    "FULL_SCALE_M",
    "SILENCE",
    "ModelSource",
    "Runaway",
    "SourceState",
    "StringSource",
    "TruthSource",
    "project",
]
