"""Displacement over time and place as an image, at any zoom without aliasing.

Where a column of pixels is shorter than the time between two of the take's pictures, every picture is drawn. Where it
is longer, but a small part of a period, each place shows its extreme, with its sign. Where it is longer still, signs
would alias (moiré): each place shows its largest magnitude, from envelopes that are computed once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from app.rendering import SOURCES, Take

QUANTITIES = (*SOURCES, "error")
STRIDE_S = 0.001  # of the envelopes
BLOCK_FRAMES = 2048  # of a take, computed at a time: a millisecond or two, so that the interpreter is soon free again
LARGEST_SHARE = 1 / 12  # the longest column, as a share of the fundamental's period, for which signs are drawn

Detail = Literal["frames", "extremes", "envelope"]


@dataclass(frozen=True)
class Picture:
    """An image of the motion.

    Attributes:
        displacement_m: float32 (places, columns).
        start_s, stop_s: the times of its edges.
        detail: what a column shows: one picture of the take, the extreme of several, or their largest magnitude.
    """

    displacement_m: NDArray[np.float32]
    start_s: float
    stop_s: float
    detail: Detail

    @property
    def signed(self) -> bool:
        """Return True if it shows displacements with their signs, and not magnitudes."""
        return self.detail != "envelope"

    def at(self, time_s: float, place: float) -> float | None:
        """The displacement in m drawn at a time and a place, 0 … 1, of the string. None: outside the image."""
        places, columns = self.displacement_m.shape
        if not (self.start_s <= time_s < self.stop_s and 0 <= place <= 1):
            return None
        column = int((time_s - self.start_s) / (self.stop_s - self.start_s) * columns)
        return float(self.displacement_m[round(place * (places - 1)), column])


def motion_of(take: Take, quantity: str, first: int, last: int) -> NDArray[np.float32]:
    """Pictures first … last - 1 in m, (pictures, places), of "model", "truth" or "error": model − truth."""
    if quantity == "error":
        return take.motion_m("model")[first:last] - take.motion_m("truth")[first:last]
    return take.motion_m(quantity)[first:last]


class Envelopes:
    """The largest magnitude of each place in each millisecond (a column) of a take, for each of QUANTITIES.

    A `Growing`: one thread calls `advance`, and any thread reads the columns that are ready.
    """

    def __init__(self, take: Take) -> None:
        self.take = take
        self.stride = max(round(STRIDE_S * take.frames_hz), 1)  # pictures
        self.ready = 0  # columns so far
        columns = take.frames // self.stride  # the rest at the end, below a millisecond, is left out
        self._largest_m = {name: np.empty((columns, take.info.grid_points), np.float32) for name in QUANTITIES}
        self._peaks_m = {name: np.empty(columns, np.float32) for name in QUANTITIES}  # of all places
        self._columns = columns  # when complete

    @property
    def complete(self) -> bool:
        return self.ready == self._columns

    def advance(self) -> bool:
        """Compute the next columns; return False where the take has none yet, or all are ready."""
        most = max(BLOCK_FRAMES // self.stride, 1)  # columns
        count = min(self.take.ready_frames // self.stride - self.ready, self._columns - self.ready, most)
        if count <= 0:
            return False
        start, stop = self.ready * self.stride, (self.ready + count) * self.stride
        for name, largest in self._largest_m.items():
            frames = motion_of(self.take, name, start, stop).reshape(count, self.stride, -1)
            columns = slice(self.ready, self.ready + count)
            largest[columns] = np.maximum(frames.max(axis=1), -frames.min(axis=1))
            self._peaks_m[name][columns] = largest[columns].max(axis=1)
        self.ready += count
        return True

    def largest_m(self, quantity: str) -> NDArray[np.float32]:
        """The largest magnitudes that are ready, (columns, places)."""
        return self._largest_m[quantity][: self.ready]

    def typical_m(self, quantity: str, times_s: tuple[float, float]) -> float:
        """The 1.5-fold median, over these times, of the string's peak, as far as it is ready. 0 where nothing is."""
        column_s = self.stride / self.take.frames_hz
        first, last = int(times_s[0] / column_s), int(times_s[1] / column_s) + 1
        peaks_m = self._peaks_m[quantity][first : min(last, self.ready)]
        return 1.5 * float(np.median(peaks_m)) if len(peaks_m) else 0.0


def picture(envelopes: Envelopes, quantity: str, times_s: tuple[float, float], columns: int) -> Picture | None:
    """The image of a part of a take, as far as it is ready; None where nothing is.

    Args:
        quantity: one of QUANTITIES.
        times_s: begin and end of the part.
        columns: about how many the image has: its width in pixels.
    """
    take = envelopes.take
    rate_hz = take.frames_hz
    detail = detail_for(take, times_s, columns)
    stride = envelopes.stride if detail == "envelope" else 1  # pictures; all below is counted in strides
    ready = envelopes.ready if detail == "envelope" else take.ready_frames
    first = int(times_s[0] * rate_hz) // stride
    last = int(np.ceil(times_s[1] * rate_hz / stride)) + 1
    edges = np.linspace(first, last, min(last - first, columns) + 1).astype(np.int64)
    edges = edges[edges <= ready]  # only whole columns, so that what has been drawn does not change
    if len(edges) < 2:
        return None
    begin, end = int(edges[0]), int(edges[-1])
    if detail == "envelope":
        values = np.maximum.reduceat(envelopes.largest_m(quantity)[begin:end], edges[:-1] - begin)
    else:
        values = motion_of(take, quantity, begin, end)
        if len(edges) <= end - begin:
            values = _extremes(values, edges[:-1] - begin)
    return Picture(np.ascontiguousarray(values.T), begin * stride / rate_hz, end * stride / rate_hz, detail)


def detail_for(take: Take, times_s: tuple[float, float], columns: int) -> Detail:
    """The detail of a column where `times_s` is drawn in so many columns."""
    column_s = (times_s[1] - times_s[0]) / columns
    if column_s * take.frames_hz <= 1:
        return "frames"
    return "extremes" if column_s * take.fundamental_hz <= LARGEST_SHARE else "envelope"


def _extremes(motion: NDArray[np.float32], starts: NDArray[np.int64]) -> NDArray[np.float32]:
    """The value furthest from 0, with its sign, of each segment that begins at `starts`, (segments, places)."""
    highest, lowest = np.maximum.reduceat(motion, starts), np.minimum.reduceat(motion, starts)
    return np.where(highest >= -lowest, highest, lowest)
