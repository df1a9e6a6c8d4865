"""Slow motion as under a stroboscope: the times of its flashes, and the string at them.

Sound and picture share one playhead, and the sound is not slowed. Each flash shows the string within a period of the
playhead, at a phase that advances slowly. The times are known beforehand, so that the string at them is rendered with
the motion: between two pictures it moves too far for interpolation.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

FLASH_HZ = 120  # twice a screen's rate, so that it matters little which flash falls on a picture


@dataclass(frozen=True)
class Strobe:
    """The flashes of a motion, `FLASH_HZ` for each second of the playhead.

    Attributes:
        speed: advance of the shown phase, in periods, during one period of the string. From 1 on each flash shows the
            string at the playhead itself.
        fundamental_hz: of the string at small amplitudes.
        seconds: of the motion.
    """

    speed: float
    fundamental_hz: float
    seconds: float

    @cached_property
    def times_s(self) -> NDArray[np.float64]:
        """The time of the motion that each flash shows, (flashes,): within one period of the playhead's."""
        places = np.arange(int(self.seconds * FLASH_HZ) + 1) / FLASH_HZ
        if self.speed < 1:
            periods = places * self.fundamental_hz
            places = (np.floor(periods) + self.speed * periods % 1.0) / self.fundamental_hz
        return np.minimum(places, self.seconds)

    def flash(self, position_s: float) -> int:
        """Index of the last flash up to the playhead."""
        return min(max(int(position_s * FLASH_HZ), 0), len(self.times_s) - 1)


class Flashes:
    """The string at a strobe's flashes, by linear interpolation between two samples. Grows as a motion does.

    Attributes:
        ready: flashes so far.
    """

    def __init__(self, strobe: Strobe, rate_hz: int, frames: int, grid_points: int) -> None:
        self.strobe = strobe
        places = np.minimum(strobe.times_s * rate_hz, frames - 1.0)
        before = np.minimum(places.astype(np.int64), max(frames - 2, 0))
        after = np.minimum(before + 1, frames - 1)
        share = places - before
        self._parts = [(before, 1 - share), (after, share)]  # by flash: the two frames around it, and their weights
        self._needed = np.unique(np.concatenate([before, after]))  # frames, ascending
        self._last = after  # the last frame that each flash needs, (flashes,)
        self._shapes_m = np.zeros((len(places), grid_points), np.float32)  # (flashes, grid points)
        self.ready = 0

    def needed(self, first: int, stop: int) -> NDArray[np.int64]:
        """The frames of first … stop - 1 that are needed for flashes, ascending."""
        return self._needed[np.searchsorted(self._needed, first) : np.searchsorted(self._needed, stop)]

    def take(self, stop: int, numbers: NDArray[np.int64], frames_m: NDArray[np.float32]) -> None:
        """Add frames with these ascending numbers, (frames, grid_points) in m.

        All frames needed before `stop` must be among these or have been added before.
        """
        for part_numbers, shares in self._parts:
            places = np.searchsorted(numbers, part_numbers)
            within = np.flatnonzero(places < len(numbers))
            within = within[numbers[places[within]] == part_numbers[within]]
            self._shapes_m[within] += shares[within, None].astype(np.float32) * frames_m[places[within]]
        late = self._last >= stop
        self.ready = int(late.argmax()) if late.any() else len(late)

    def shape_m(self, index: int) -> NDArray[np.float32] | None:
        """The string (grid_points,) at a flash; None where it is not ready."""
        return self._shapes_m[index] if index < self.ready else None
