"""The sources of sound: a preset's model and its physics behind one interface, in metres and in NumPy.

A source is given initial displacements, yields frames in blocks, and keeps nothing: the state is passed. Rendering,
comparing, the command line and the app treat model and truth alike through it. Torch is imported with the first
model that needs it: strings of `koopman_tension` and the truth do not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from engine.levels import LEAST_PEAK_M, RUNAWAY_FACTOR
from engine.models._tension_law import TensionArrays
from engine.presets import Preset, PresetInfo
from engine.resonators.base import Array
from engine.truth import ModalState, SplittingSolver

if TYPE_CHECKING:
    from engine.models.base import StringModel

Floats = NDArray[np.floating[Any]]
SILENCE = 1e-9  # of a mode, of all: what the truth leaves out is 180 dB down


class Runaway(RuntimeError):
    """A model's output stopped being a string's: not finite, or far beyond its initial displacement."""

    def __init__(self, time_s: float) -> None:
        super().__init__(f"the model's output diverges {time_s:.3f} s after the pluck; shorten it or play the truth")
        self.time_s = time_s


@dataclass(frozen=True)
class SourceState:
    """The state of a source, which it is given with each call and returns."""

    inner: Any  # the model's or the solver's own
    frame: int  # frames since the release
    limit_m: float  # the largest displacement that is taken for a string's; beyond it is a `Runaway`

    def after(self, inner: Any, steps: int) -> SourceState:
        return SourceState(inner, self.frame + steps, self.limit_m)


class TorchModel:
    """A model of torch that is given arrays and gives arrays, as `TensionArrays` does; methods as of `StringModel`.

    Displacement is in normalised units, and no gradient is kept.
    """

    def __init__(self, model: StringModel[Any]) -> None:
        self._model = model

    def encode(self, displacement: NDArray[np.float32]) -> Any:
        return self._call(self._model.encode, displacement)

    def advance(self, state: Any, steps: int, readout: Array | None = None) -> tuple[Floats, Any]:
        frames, after = self._call(self._model.advance, state, steps, readout)
        return frames.numpy(), after

    def sample(self, state: Any, frames: NDArray[np.int64], steps: int) -> tuple[Floats, Any]:
        motion, after = self._call(self._model.sample, state, frames, steps)
        return motion.numpy(), after

    def log_eigenvalues(self) -> list[NDArray[np.complex128]]:
        return [log.numpy() for log in self._call(self._model.log_eigenvalues)]

    @staticmethod
    def _call(method: Callable[..., Any], *values: Any) -> Any:
        """The results of a method for these values, arrays among them as tensors, without gradients."""
        import torch

        with torch.inference_mode():
            return method(*(torch.from_numpy(value) if isinstance(value, np.ndarray) else value for value in values))


def array_model(preset: Preset) -> TensionArrays | TorchModel:
    """The model of a preset on arrays, as `StringModel` has it; no motion is checked. Of one string: and torch."""
    if preset.info.of_many_strings:
        return TensionArrays(preset.configuration, preset.weights)
    return TorchModel(preset.model)


class ModelSource:
    """A preset's model. Its start is given, and its frames come, in m; frame 0 is the release.

    Attributes:
        any_frame: whether `sample` takes much less time than `advance`, because it leaves the other frames or their
            shapes out.
    """

    def __init__(self, preset: Preset) -> None:
        self._model = array_model(preset)
        self.any_frame = preset.info.of_many_strings or preset.model.any_frame
        self._scale_m = preset.info.scale_m
        self.rate_hz = preset.info.rate_hz
        self.grid_points = preset.info.grid_points

    def start(self, displacement_m: Array) -> SourceState:
        """The state at frame 0 for displacements (batch, grid_points), already projected on the modes in use."""
        _check_grid(displacement_m, self.grid_points)
        inner = self._model.encode((displacement_m / self._scale_m).astype(np.float32))
        peak_m = max(float(np.abs(displacement_m).max(initial=0.0)), LEAST_PEAK_M)
        return SourceState(inner, 0, RUNAWAY_FACTOR * peak_m)

    def advance(self, state: SourceState, steps: int, readout: Array | None = None) -> tuple[Floats, SourceState]:
        """The next frames in m, (batch, steps, grid_points), and the state after them.

        Args:
            readout: (grid_points, points), applied to each frame, which then is (points,); None: it is on the grid.

        Raises:
            Runaway: see there.
        """
        frames, inner = self._model.advance(state.inner, steps, readout)
        return self._checked(frames, np.arange(1, steps + 1), state), state.after(inner, steps)

    def sample(self, state: SourceState, frames: NDArray[np.int64], steps: int) -> tuple[Floats, SourceState]:
        """Sample the motion on the whole grid, as `advance`, keeping some frames, (batch, frames, grid_points).

        Args:
            frames: their numbers, ascending, of 1 … steps; int64 (frames,).

        Raises:
            Runaway: see there.
        """
        if not self.any_frame or len(frames) == steps:
            every, after = self.advance(state, steps)
            return every if len(frames) == steps else every[:, frames - 1], after
        motion, inner = self._model.sample(state.inner, frames, steps)
        return self._checked(motion, frames, state), state.after(inner, steps)

    def _checked(self, displacement: Floats, frames: NDArray[np.int64], state: SourceState) -> Floats:
        """The displacement in m, checked against the state's limit. Raises Runaway.

        Args:
            displacement: normalised, (batch, frames, points).
            frames: numbers of the frames since the state's, (frames,).
        """
        displacement = displacement * displacement.dtype.type(self._scale_m)
        possible = np.abs(displacement) <= state.limit_m  # False for a NaN
        if not possible.all():
            first = int(np.argmin(possible.all(axis=(0, 2))))
            raise Runaway((state.frame + int(frames[first])) / self.rate_hz)
        return displacement


class TruthSource:
    """The physics of a preset's string, at the preset's rate and with its modes; the methods of `ModelSource`.

    Args:
        substeps: of the solver (see `SplittingSolver`); None is its default, exact to 1e-7.
    """

    def __init__(self, info: PresetInfo, substeps: int | None = None) -> None:
        self.rate_hz = info.rate_hz
        self.grid_points = info.grid_points
        self.any_frame = True  # it steps through all of them; their shapes are most of the cost
        self._resonator = info.resonator
        self._solver = SplittingSolver(self._resonator, info.rate_hz, substeps=substeps, silence=SILENCE)

    def start(self, displacement_m: Array) -> SourceState:
        _check_grid(displacement_m, self.grid_points)
        return SourceState(ModalState.at_rest(self._resonator.to_modes(displacement_m)), 0, float("inf"))

    def advance(self, state: SourceState, steps: int, readout: Array | None = None) -> tuple[Floats, SourceState]:
        amplitudes, inner = self._solver.advance(state.inner, steps)
        shapes = self._resonator.shapes
        return amplitudes @ (shapes if readout is None else shapes @ readout), state.after(inner, steps)

    def sample(self, state: SourceState, frames: NDArray[np.int64], steps: int) -> tuple[Floats, SourceState]:
        amplitudes, inner = self._solver.sample(state.inner, frames, steps)
        return amplitudes @ self._resonator.shapes, state.after(inner, steps)


StringSource = ModelSource | TruthSource


def _check_grid(displacement: Array, grid_points: int) -> None:
    if displacement.ndim != 2 or displacement.shape[1] != grid_points:
        raise ValueError(
            f"initial displacement must have shape (batch, {grid_points}), not {tuple(displacement.shape)}"
        )
