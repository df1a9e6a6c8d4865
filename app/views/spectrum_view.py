"""The spectrum at the playhead: model and truth, dB against log frequency."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtWidgets import QWidget

from app.views import theme

FLOOR_DB, CEILING_DB = -130.0, 0.0
LOWEST_HZ = 50.0
WINDOW_S = 0.18
COLUMNS = 480


@dataclass(frozen=True)
class Analyser:
    """A Hann-windowed magnitude spectrum on `COLUMNS` logarithmic columns, 0 dB for a full-scale sine."""

    rate_hz: int

    @property
    def window_frames(self) -> int:
        """The power of two nearest to `WINDOW_S`."""
        return 2 ** round(math.log2(WINDOW_S * self.rate_hz))

    @property
    def column_hz(self) -> NDArray[np.float64]:
        return np.geomspace(LOWEST_HZ, self.rate_hz / 2, COLUMNS)

    def level_db(self, signal: NDArray[np.float32]) -> NDArray[np.float64]:
        """Levels (COLUMNS,) of the first `window_frames` of a signal in units of full scale."""
        frames = self.window_frames
        padded = 4 * frames
        block = np.zeros(frames)
        block[: min(frames, len(signal))] = signal[:frames]
        window = np.hanning(frames)
        magnitude = np.abs(np.fft.rfft((block - block.mean()) * window, padded)) * 2 / window.sum()
        bins = self.column_hz * padded / self.rate_hz
        columns = np.interp(bins, np.arange(len(magnitude)), magnitude)
        # where columns are wider than bins, the loudest of each, so that no partial falls between two columns
        middles = np.sqrt(bins[1:] * bins[:-1])
        first = np.concatenate([bins[:1], middles]).astype(int)
        columns = np.maximum(
            columns, np.where(np.diff(first, append=len(magnitude)) > 1, np.maximum.reduceat(magnitude, first), 0)
        )
        return np.maximum(20 * np.log10(columns + 1e-12), FLOOR_DB)


class SpectrumView(pg.PlotWidget):
    """Two curves on locked axes; the heard source is on top."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName("Spectrum")
        self.setToolTip("The spectrum at the listening point, at the playhead")
        self.setMinimumHeight(84)
        item = self.getPlotItem()
        item.setLogMode(x=True)
        item.setLabel("bottom", "frequency", units="Hz", siPrefix=False)
        item.setLabel("left", "dB")
        item.showGrid(x=True, y=True, alpha=0.18)
        item.setMenuEnabled(False)
        item.hideButtons()
        item.setMouseEnabled(False, False)
        item.getAxis("bottom").setTicks(
            [[(math.log10(f), f"{f:g}" if f < 1000 else f"{f / 1000:g}k") for f in _LABELLED_HZ]]
        )
        item.getAxis("bottom").enableAutoSIPrefix(False)
        self._curves = {
            name: item.plot(pen=pg.mkPen(theme.SOURCE_COLOURS[name], width=1)) for name in ("truth", "model")
        }
        self._fill(self._curves["truth"])
        self._analyser = Analyser(16_000)
        self.set_rate(16_000)
        self.set_heard("model")

    @property
    def analyser(self) -> Analyser:
        return self._analyser

    def set_rate(self, rate_hz: int) -> None:
        """Fits the frequency axis to a model's rate."""
        self._analyser = Analyser(rate_hz)
        self.getPlotItem().setRange(
            xRange=(math.log10(LOWEST_HZ), math.log10(rate_hz / 2)), yRange=(FLOOR_DB, CEILING_DB), padding=0
        )

    def set_heard(self, source: str) -> None:
        for name, curve in self._curves.items():
            colour = theme.translucent(theme.SOURCE_COLOURS[name], 255 if name == source else 150)
            curve.setPen(pg.mkPen(colour, width=1))
            curve.setZValue(2 if name == source else 1)

    def show_signals(self, signals: dict[str, NDArray[np.float32]]) -> None:
        """Signals in units of full scale, at least a window each."""
        for name, signal in signals.items():
            self._curves[name].setData(self._analyser.column_hz, self._analyser.level_db(signal))

    @staticmethod
    def _fill(curve: pg.PlotDataItem) -> None:
        curve.setFillLevel(FLOOR_DB)
        curve.setBrush(pg.mkBrush(theme.translucent(theme.TRUTH, 28)))


_LABELLED_HZ = (50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000)
