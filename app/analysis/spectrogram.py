"""Levels over time and frequency of the sound at the listening point, by short-time Fourier transforms."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from app.analysis.heard import HeardSignal
from app.rendering import SOURCES, Sounding
from app.rendering.take import Listened

FLOOR_DB = -150.0  # lower levels are shown as this
WINDOW_PERIODS = 7.0  # of the fundamental: a little more than a Hann window needs to separate partials
OVERLAP = 8  # windows over any one time
COLUMNS_AT_A_TIME = 32  # in a call of `advance`


class Spectrogram:
    """Spectrograms of model, truth and error in dB, a few columns at a time.

    A `Growing`: one thread calls `advance`, and any thread reads the columns that are ready.

    A sine at the pick-up's full scale is 0 dB. Column k is of the window centred at k·hop_s; the last one ends with
    the take. Before its start the signal is mirrored, as the motion of a string released from rest would be. The
    velocity of a string and the pressure of a drum are mirrored with the other sign. Without that, the sudden start
    would show as a click that is not heard.

    Attributes:
        ready: columns so far.
        levels_db: (columns, bins) each, for "model", "truth" and "error": model − truth, of the signals.
    """

    def __init__(self, take: Sounding, listened: Listened) -> None:
        self.take, self.listened = take, listened
        self._heard = {name: HeardSignal(listened.signals, name) for name in SOURCES}  # by source
        rate_hz = take.rate_hz
        self.window_frames = max(2 ** round(math.log2(WINDOW_PERIODS * rate_hz / take.fundamental_hz)), 16)
        self.hop = self.window_frames // OVERLAP  # frames from one column to the next
        self.ready = 0
        self._mirror_sign = -1 if take.pickup in ("velocity", "pressure") else 1  # of what is mirrored at the start
        self._window = np.hanning(self.window_frames + 1)[:-1].astype(np.float32)
        self._window *= np.float32(2 / self._window.sum() / take.full_scale)
        self.columns = self._columns_of(self._heard["truth"].frames)  # when complete
        shape = (self.columns, self.window_frames // 2 + 1)
        self.levels_db = {name: np.empty(shape, np.float32) for name in ("model", "truth", "error")}

    @property
    def complete(self) -> bool:
        return self.ready == self.columns

    @property
    def hop_s(self) -> float:
        return self.hop / self.take.rate_hz

    @property
    def bin_hz(self) -> float:
        """The distance between two bins."""
        return self.take.rate_hz / self.window_frames

    def advance(self) -> bool:
        """Compute the next columns; return False where the take has none yet, or all are ready."""
        rendered = self._columns_of(min(signal.ready for signal in self._heard.values()))
        count = min(rendered - self.ready, COLUMNS_AT_A_TIME)
        if count <= 0:
            return False
        model, truth = (self._transforms(name, count) for name in ("model", "truth"))
        for name, bins in (("model", model), ("truth", truth), ("error", model - truth)):
            magnitude = np.maximum(np.abs(bins), 10 ** (FLOOR_DB / 20))
            self.levels_db[name][self.ready : self.ready + count] = 20 * np.log10(magnitude)
        self.ready += count
        return True

    def _columns_of(self, frames: int) -> int:
        """The number of columns whose window lies in so many frames."""
        half = self.window_frames // 2
        return (frames - half - 1) // self.hop + 1 if frames > half else 0

    def _transforms(self, source: str, count: int) -> NDArray[np.complexfloating]:
        """The transforms of the next columns, (count, bins)."""
        first = self.ready * self.hop - self.window_frames // 2
        last = first + (count - 1) * self.hop + self.window_frames
        source_signal = self._heard[source]
        signal = source_signal.read(max(first, 0), last)
        if first < 0:
            mirror = self._mirror_sign * source_signal.read(1, 1 - first)[::-1]
            signal = np.concatenate([mirror, signal])
        windows = np.lib.stride_tricks.sliding_window_view(signal, self.window_frames)[:: self.hop]
        return np.fft.rfft(windows * self._window, axis=1)


class FrequencyRows:
    """The levels of bins as levels of an image's rows, from `lowest_hz` up to `highest_hz`, or half the rate.

    A row wider than a bin is the loudest of its bins, so that no partial is lost between two rows. A narrower row is
    interpolated.
    """

    def __init__(
        self, bins: int, bin_hz: float, rows: int, lowest_hz: float, logarithmic: bool, highest_hz: float = math.inf
    ) -> None:
        half_rate_hz = (bins - 1) * bin_hz
        space = np.geomspace if logarithmic else np.linspace
        edges = space(lowest_hz, min(highest_hz, half_rate_hz), rows + 1) / bin_hz
        middle = np.sqrt(edges[1:] * edges[:-1]) if logarithmic else (edges[1:] + edges[:-1]) / 2
        self._below = np.minimum(middle.astype(int), bins - 2)  # (rows,), the bin below each row's middle
        self._share = (middle - self._below).astype(np.float32)  # (rows,), the weight of the bin above
        starts = np.ceil(edges[:-1] - 0.5).astype(int).clip(0, bins - 1)
        self._starts = starts  # (rows,), the first bin of each row
        self._stop = bins if highest_hz >= half_rate_hz else max(math.ceil(edges[-1] - 0.5), int(starts[-1]) + 1)
        self._wide = np.diff(starts, append=self._stop) > 1  # (rows,), where a row has several bins

    def of(self, levels_db: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the levels by row, (columns, bins) → (columns, rows)."""
        between = levels_db[:, self._below] * (1 - self._share) + levels_db[:, self._below + 1] * self._share
        loudest = np.maximum.reduceat(levels_db[:, : self._stop], self._starts, axis=1)
        return np.where(self._wide, np.maximum(loudest, between), between)
