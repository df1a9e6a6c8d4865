"""A take: one pluck with the motion of model and truth, growing while it is rendered."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray

from engine.pluck import Pluck
from engine.presets import PresetInfo
from engine.resonators.sine_transform import listening_weights

SOURCES = ("model", "truth")


class Motion:
    """Displacement of one source on its grid, (frames, grid_points) in m, growing at its end."""

    def __init__(self, rate_hz: int, grid_points: int, seconds: float) -> None:
        self.rate_hz = rate_hz
        self.frames = round(seconds * rate_hz) + 1
        self.ready_frames = 0
        self._m = np.zeros((self.frames, grid_points), np.float32)

    @property
    def complete(self) -> bool:
        return self.ready_frames == self.frames

    @property
    def ready_bytes(self) -> int:
        return self.ready_frames * self._m.shape[1] * self._m.itemsize

    def append(self, frames_m: NDArray[np.float32]) -> None:
        start, stop = self.ready_frames, self.ready_frames + len(frames_m)
        self._m[start:stop] = frames_m
        self.ready_frames = stop

    def read(self, start: int = 0, stop: int | None = None) -> NDArray[np.float32]:
        """What is ready of frames start … stop."""
        ready = self.ready_frames
        return self._m[min(start, ready) : ready if stop is None else min(stop, ready)]


class Take:
    """Displacement of both sources on the grid at the preset's rate, and of other presets' models beside them.

    One thread appends and any thread reads: frames are written first, then `ready_frames` is raised; what lies
    below it never changes.

    Attributes:
        frames: number of frames when complete, the initial displacement among them.
        model_ends_s: when the model's output ran away, the time of its last believable frame; it is at rest then.
        others: motions of other presets' models for the same pluck, by source, each at its own rate and on its
            own grid.
        fundamental_hz: of the string at rest.
    """

    def __init__(self, preset_name: str, info: PresetInfo, pluck: Pluck, seconds: float) -> None:
        self.preset_name = preset_name
        self.info = info
        self.pluck = pluck
        self.model_ends_s: float | None = None
        self._motions = {name: Motion(info.rate_hz, info.grid_points, seconds) for name in SOURCES}
        self.frames = self._motions["truth"].frames
        self.others: dict[str, Motion] = {}
        self.fundamental_hz = float(info.resonator.omega[0]) / (2 * np.pi)

    @property
    def ready_frames(self) -> int:
        return self._motions["truth"].ready_frames

    @property
    def complete(self) -> bool:
        return self.ready_frames == self.frames

    @property
    def seconds(self) -> float:
        return (self.frames - 1) / self.info.rate_hz

    @property
    def ready_bytes(self) -> int:
        """Memory that its frames take so far, those of `others` among them."""
        return sum(motion.ready_bytes for motion in (*self._motions.values(), *self.others.values()))

    def motion(self, source: str) -> Motion:
        """The growing motion of a source, of "model", "truth" or one of `others`."""
        return self._motions[source] if source in self._motions else self.others[source]

    def append(self, model_m: NDArray[np.float32], truth_m: NDArray[np.float32]) -> None:
        """Adds frames (frames, grid_points) of both sources."""
        self._motions["model"].append(model_m)
        self._motions["truth"].append(truth_m)

    def motion_m(self, source: str) -> NDArray[np.float32]:
        """The frames so far, (ready_frames, grid_points), in m."""
        return self.motion(source).read(0, self.ready_frames if source in SOURCES else None)

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
        return self.motion_m(source)[start:stop] @ _weights(listen, self.info.grid_points)


@lru_cache(maxsize=8)  # asked for many times a second
def _weights(listen: float, grid_points: int) -> NDArray[np.float32]:
    """(grid_points,): displacement @ weights is that at the listening point."""
    return listening_weights(torch.tensor([listen]), grid_points)[:, 0].float().numpy()
