"""A take's sources as seen and heard: model, truth, another preset's model, or the difference with its gain.

A motion is the whole string, picture by picture; a signal is what the pick-up senses at the listening points, sample
by sample. Both grow with their take.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from app.rendering import SOURCES
from app.rendering.take import FrameSeries, Pictures, Signal
from app.shared.vocabulary import DIFFERENCE


@dataclass(frozen=True)
class _Heard:
    """A source of a take, times `gain`, as its frames (frames, places).

    Attributes:
        by_source: the rendered frames by source.
        source: "model", "truth", "difference" (model minus truth), or another preset's.
    """

    by_source: Mapping[str, FrameSeries]
    source: str
    gain: float = 1.0

    @cached_property
    def _series(self) -> list[FrameSeries]:
        return [self.by_source[name] for name in _parts(self.source)]

    @property
    def there(self) -> bool:
        """Return True if any of it has been rendered; another preset's model may begin after the take."""
        return all(name in self.by_source for name in _parts(self.source)) and self.ready > 0

    @property
    def rate_hz(self) -> float:
        return self._series[0].rate_hz

    @property
    def frames(self) -> int:
        """Frames when complete."""
        return self._series[0].frames

    @property
    def ready(self) -> int:
        """Frames so far."""
        return min(series.ready_frames for series in self._series)

    def read_all(self, first: int, stop: int) -> NDArray[np.float32]:
        """The frames first … stop - 1 that are ready, (frames, places)."""
        stop = min(stop, self.ready)
        return _subtract_parts([series.read(first, stop) for series in self._series], self.gain)


class HeardMotion(_Heard):
    """Displacement of a source on its grid in m, at its own rate of pictures: of the motions of a take."""

    by_source: Mapping[str, Pictures]

    @property
    def grid_points(self) -> int:
        return self._series[0].places

    def shape(self, position_s: float) -> NDArray[np.float32]:
        """The string (grid_points,) in m that slow motion shows at the playhead."""
        motions = [self.by_source[name] for name in _parts(self.source)]
        return _subtract_parts([motion.shape_m(position_s) for motion in motions], self.gain)


class HeardSignal(_Heard):
    """The signal that a pick-up senses of a source at the listening points, in m or m/s: of those of a take."""

    by_source: Mapping[str, Signal]

    @property
    def rate_hz(self) -> int:
        return self.by_source[_parts(self.source)[0]].rate_hz

    def read(self, first: int, stop: int) -> NDArray[np.float32]:
        """Read as `read_all`, at the first listening point, (frames,)."""
        return self.read_all(first, stop)[:, 0]


def _parts(source: str) -> tuple[str, ...]:
    """The sources that make it up: one, or two of which the second is subtracted from the first."""
    return SOURCES if source == DIFFERENCE else (source,)


def _subtract_parts(parts: list[NDArray[np.float32]], gain: float) -> NDArray[np.float32]:
    """The first of one or two arrays of one shape, less the second, times `gain`."""
    values, *subtracted = parts
    if subtracted:
        values = values - subtracted[0]
    return values if gain == 1 else np.float32(gain) * values
