"""A take's sources as seen and heard: model, truth, another preset's model, or the difference with its gain.

A motion is the whole string, picture by picture; a signal is what the pick-up senses at the listening points, sample
by sample. Both grow with their take.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from app.rendering import SOURCES, Take
from app.rendering.strobe import Strobe
from app.rendering.take import Listened, Motion, Signal
from app.shared.vocabulary import DIFFERENCE


@dataclass(frozen=True)
class HeardMotion:
    """Displacement of one source on its grid, at its own rate of pictures, times `gain`."""

    take: Take
    source: str
    gain: float = 1.0

    @property
    def there(self) -> bool:
        """Whether any of it has been rendered; another preset's model may begin after the take."""
        return all(name in SOURCES or name in self.take.others for name in _parts(self.source)) and self.ready > 0

    @property
    def rate_hz(self) -> float:
        """Pictures per second."""
        return self._motions[0].rate_hz

    @property
    def grid_points(self) -> int:
        return self._motions[0].read(0, 0).shape[1]

    @property
    def frames(self) -> int:
        """Pictures when complete."""
        return self._motions[0].frames

    @property
    def ready(self) -> int:
        """Pictures so far."""
        return min(motion.ready_frames for motion in self._motions)

    def read(self, first: int, stop: int) -> NDArray[np.float32]:
        """The pictures first … stop - 1 that are ready, (frames, grid_points) in m."""
        stop = min(stop, self.ready)
        return _combined([motion.read(first, stop) for motion in self._motions], self.gain)

    def shape(self, position_s: float) -> NDArray[np.float32]:
        """The string (grid_points,) in m that slow motion shows at the playhead."""
        return _combined([motion.shape_m(position_s) for motion in self._motions], self.gain)

    def strobes(self, position_s: float) -> list[Strobe | None]:
        """The strobes whose flashes `shape` is made of; None where it is the nearest picture instead."""
        return [motion.strobe_at(position_s) for motion in self._motions]

    @cached_property
    def _motions(self) -> list[Motion]:
        return [self.take.motion(name) for name in _parts(self.source)]


@dataclass(frozen=True)
class HeardSignal:
    """What a pick-up senses of one source at the listening points, in m or m/s, times `gain`."""

    listened: Listened
    source: str
    gain: float = 1.0

    @property
    def there(self) -> bool:
        """Whether any of it has been rendered; another preset's model may begin after the take."""
        return all(name in self.listened.signals for name in _parts(self.source)) and self.ready > 0

    @property
    def rate_hz(self) -> int:
        return self._signals[0].rate_hz

    @property
    def frames(self) -> int:
        """Frames when complete."""
        return self._signals[0].frames

    @property
    def ready(self) -> int:
        """Frames so far."""
        return min(signal.ready_frames for signal in self._signals)

    def read(self, first: int, stop: int) -> NDArray[np.float32]:
        """The frames first … stop - 1 that are ready, at the first listening point, (frames,)."""
        return self.read_points(first, stop)[:, 0]

    def read_points(self, first: int, stop: int) -> NDArray[np.float32]:
        """As `read`, at all listening points, (frames, points)."""
        stop = min(stop, self.ready)
        return _combined([signal.read(first, stop) for signal in self._signals], self.gain)

    @cached_property
    def _signals(self) -> list[Signal]:
        return [self.listened.signals[name] for name in _parts(self.source)]


def _parts(source: str) -> tuple[str, ...]:
    """The sources that make it up: one, or two of which the second is subtracted from the first."""
    return SOURCES if source == DIFFERENCE else (source,)


def _combined(parts: list[NDArray[np.float32]], gain: float) -> NDArray[np.float32]:
    values, *subtracted = parts
    if subtracted:
        values = values - subtracted[0]
    return values if gain == 1 else np.float32(gain) * values
