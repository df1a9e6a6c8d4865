"""One source of a take on its way: rendered onwards by blocks, silent from where it runs away."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from engine.pluck import Pluck
from engine.presets import PresetInfo
from engine.sources import Runaway, StringSource, project


class Line:
    """Frames of a source for a pluck, the initial displacement first.

    Args:
        source: None is a string at rest.

    Attributes:
        frames: how many there are in all.
        done: frames rendered so far.
        ends_s: the time of the last believable frame, where the source ran away; it is at rest from there on.
    """

    def __init__(self, source: StringSource | None, info: PresetInfo, pluck: Pluck, seconds: float) -> None:
        self.rate_hz = info.rate_hz
        self.grid_points = info.grid_points
        self.frames = round(seconds * info.rate_hz) + 1
        self.done = 0
        self.ends_s: float | None = None
        self._source = source
        initial = _initial_m(pluck, info.grid_points, info.modes)
        self._initial = initial if source is not None else torch.zeros_like(initial)
        self._state = None if source is None else source.start(initial)

    @property
    def complete(self) -> bool:
        return self.done == self.frames

    def until(self, time_s: float) -> int:
        """How many more frames there are before a time."""
        return max(0, min(self.frames, math.ceil(time_s * self.rate_hz)) - self.done)

    def advance(self, frames: int) -> NDArray[np.float32]:
        """The next `frames` in m, (frames, grid_points)."""
        blocks = [torch.zeros(0, self.grid_points)]
        first = self.done == 0 and frames > 0
        if first:
            blocks.append(self._initial.float())
        if frames > first:
            blocks.append(self._steps(frames - first).float())
        self.done += frames
        return torch.cat(blocks).numpy()

    def _steps(self, steps: int) -> Tensor:
        if self._source is not None and self._state is not None and self.ends_s is None:
            try:
                block, self._state = self._source.advance(self._state, steps)
                return block[0]
            except Runaway:  # at rest from here on: it must never reach a loudspeaker
                self.ends_s = max(self.done - 1, 0) / self.rate_hz
        return torch.zeros(steps, self.grid_points)


@lru_cache(maxsize=8)  # every source of a take begins with the same
def _initial_m(pluck: Pluck, grid_points: int, modes: int) -> Tensor:
    """The string as it is let go, (1, grid_points)."""
    return project(pluck.displacement(grid_points), modes)[None]
