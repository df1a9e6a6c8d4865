"""A take's sources as they are heard: model, truth, another preset's model, or the difference with its gain.

A motion is all of the string, a signal what the pick-up senses at a listening point. Both grow with their take, and
any part of them can be read without the parts before.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from app.rendering import SOURCES, Take
from app.rendering.take import Motion
from app.rendering.velocity import REACH_FRAMES, Differentiator
from app.shared.vocabulary import DIFFERENCE
from engine.voices import Ear


@dataclass(frozen=True)
class HeardMotion:
    """Displacement of one source on its grid, at its own rate; `gain` times what it is."""

    take: Take
    source: str
    gain: float = 1.0

    @property
    def there(self) -> bool:
        """Whether any of it has been rendered: another preset's model begins later than the take."""
        return all(name in SOURCES or name in self.take.others for name in self._parts) and self.ready > 0

    @property
    def rate_hz(self) -> int:
        return self._motions[0].rate_hz

    @property
    def grid_points(self) -> int:
        return self._motions[0].read(0, 0).shape[1]

    @property
    def frames(self) -> int:
        """When complete."""
        return self._motions[0].frames

    @property
    def ready(self) -> int:
        """Frames so far."""
        return min(motion.ready_frames for motion in self._motions)

    def read(self, first: int, stop: int) -> NDArray[np.float32]:
        """What is ready of frames first … stop, (frames, grid_points) in m."""
        frames, *taken_away = self.parts(first, stop)
        if taken_away:
            frames = frames - taken_away[0]
        return frames if self.gain == 1 else np.float32(self.gain) * frames

    def parts(self, first: int, stop: int) -> list[NDArray[np.float32]]:
        """What `read` is made of before the gain: one motion, or a second that is taken away from it."""
        stop = min(stop, self.ready)
        return [motion.read(first, stop) for motion in self._motions]

    def shape(self, time_s: float) -> NDArray[np.float32]:
        """The string (grid_points,) at a time between two frames, in m; at rest where there is none yet."""
        place = min(max(time_s * self.rate_hz, 0.0), self.ready - 1.0)
        before = int(place)
        around = self.read(before, before + 2)
        share = np.float32(place - before)
        return around[0] * (1 - share) + around[-1] * share

    @property
    def _parts(self) -> tuple[str, ...]:
        return SOURCES if self.source == DIFFERENCE else (self.source,)

    @cached_property
    def _motions(self) -> list[Motion]:
        return [self.take.motion(name) for name in self._parts]


@dataclass(frozen=True)
class HeardSignal:
    """What a pick-up senses of a motion at the first of its points, in m or m/s."""

    motion: HeardMotion
    listening: Ear

    @property
    def ready(self) -> int:
        """Frames so far; a velocity needs some displacement behind it."""
        ready = self.motion.ready
        return ready if ready == self.motion.frames else max(0, ready - self._reach)

    def read(self, first: int, stop: int) -> NDArray[np.float32]:
        """What is ready of frames first … stop, (frames,): the same whatever was read before."""
        first, stop = min(first, self.ready), min(stop, self.ready)
        if stop <= first:
            return np.zeros(0, np.float32)
        start = max(0, first - self._reach)
        weights = self.listening.weights(self.motion.grid_points)[:, :1].float().numpy()
        picked_up, *taken_away = (frames @ weights for frames in self.motion.parts(start, stop + self._reach))
        signal: NDArray[np.floating] = self.motion.gain * (picked_up - taken_away[0] if taken_away else picked_up)
        if self._reach and len(signal) > 1:
            signal = Differentiator(self.motion.rate_hz).feed(signal, last=True)
        return signal[first - start : stop - start, 0].astype(np.float32)

    @property
    def _reach(self) -> int:
        return REACH_FRAMES if self.listening.pickup == "velocity" else 0
