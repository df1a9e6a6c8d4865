"""A take: one pluck with the motion of model and truth, growing while it is rendered."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from engine.metrics import ErrorSums
from engine.pluck import Pluck
from engine.preset import PresetInfo
from engine.sine_transform import listening_weights

SOURCES = ("model", "truth")


class Take:
    """Displacement of both sources on the grid at the preset's rate.

    One thread appends and any thread reads: frames are written first, then `ready_frames` is raised; what lies
    below it never changes.

    Attributes:
        frames: number of frames when complete, the initial displacement among them.
        model_ends_s: when the model's output ran away, the time of its last believable frame; it is at rest then.
    """

    def __init__(self, preset_name: str, info: PresetInfo, pluck: Pluck, seconds: float) -> None:
        self.preset_name = preset_name
        self.info = info
        self.pluck = pluck
        self.frames = round(seconds * info.rate_hz) + 1
        self.ready_frames = 0
        self.model_ends_s: float | None = None
        self._motion_m = {name: np.zeros((self.frames, info.grid_points), np.float32) for name in SOURCES}

    @property
    def complete(self) -> bool:
        return self.ready_frames == self.frames

    @property
    def seconds(self) -> float:
        return (self.frames - 1) / self.info.rate_hz

    @property
    def fundamental_hz(self) -> float:
        return float(self.info.string.undamped_frequencies(1)) / (2 * np.pi)

    def append(self, model_m: NDArray[np.float32], truth_m: NDArray[np.float32]) -> None:
        """Adds frames (frames, grid_points) of both sources."""
        start, stop = self.ready_frames, self.ready_frames + len(truth_m)
        self._motion_m["model"][start:stop] = model_m
        self._motion_m["truth"][start:stop] = truth_m
        self.ready_frames = stop

    def motion_m(self, source: str) -> NDArray[np.float32]:
        """The frames so far, (ready_frames, grid_points), in m."""
        return self._motion_m[source][: self.ready_frames]

    def shape_m(self, source: str, time_s: float) -> NDArray[np.float32]:
        """The string (grid_points,) at any time, between two frames by linear interpolation, in m."""
        motion = self.motion_m(source)
        if len(motion) == 0:
            return np.zeros(self.info.grid_points, np.float32)
        place = min(max(time_s * self.info.rate_hz, 0.0), len(motion) - 1.0)
        before = int(place)
        after = min(before + 1, len(motion) - 1)
        share = np.float32(place - before)
        return motion[before] * (1 - share) + motion[after] * share

    def signal_m(self, source: str, listen: float, start: int = 0, stop: int | None = None) -> NDArray[np.float32]:
        """Displacement at the listening point for frames start … stop so far, in m."""
        weights = listening_weights(torch.tensor([listen]), self.info.grid_points)[:, 0].float().numpy()
        return self.motion_m(source)[start:stop] @ weights

    def error_sums(self) -> ErrorSums:
        """Model against truth in every frame so far after the initial one, over all of the string."""
        sums = ErrorSums(self.ready_frames - 1)
        model, truth = (torch.from_numpy(self.motion_m(name)[None, 1:]) for name in SOURCES)
        sums.add(model, truth)
        return sums
