"""The waveform of the whole take at the listening point."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtWidgets import QWidget

from app.views import theme
from app.views.time_plot import TimePlot

COLUMNS = 1600


def extremes(signal: NDArray[np.float32], columns: int) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Lowest and highest value of each column, alternating: (places in samples, values) to draw as one line."""
    if len(signal) <= 2 * columns:
        return np.arange(len(signal), dtype=np.float64), signal
    edges = np.linspace(0, len(signal), columns, endpoint=False).astype(int)
    values = np.empty(2 * columns, np.float32)
    values[0::2] = np.minimum.reduceat(signal, edges)
    values[1::2] = np.maximum.reduceat(signal, edges)
    return np.repeat(edges.astype(np.float64), 2), values


class WaveformView(TimePlot):
    """One curve a source; the heard source is on top."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(
            "Waveform",
            "Click moves the playhead; the wheel zooms in time, the right button pans; double-click shows all.\n"
            "Arrow keys move the playhead, + and − zoom",
            parent,
        )
        item = self.getPlotItem()
        item.setLabel("left", "mm")
        item.showGrid(x=True, y=True, alpha=0.18)
        self._curves = {
            name: item.plot(pen=pg.mkPen(theme.SOURCE_COLOURS[name], width=1)) for name in ("truth", "model")
        }
        self.set_heard("model")

    def set_take(self, seconds: float, horizon_s: float, peak_mm: float) -> None:
        """Axes for a take of `seconds` of a model that was trained for `horizon_s`."""
        peak_mm = max(peak_mm, 1e-3)
        self.getPlotItem().setYRange(-peak_mm, peak_mm, padding=0.02)
        self.set_times(seconds, horizon_s)
        for curve in self._curves.values():
            curve.setData([], [])

    def set_heard(self, source: str) -> None:
        for name, curve in self._curves.items():
            colour = theme.translucent(theme.SOURCE_COLOURS[name], 255 if name == source else 130)
            curve.setPen(pg.mkPen(colour, width=1))
            curve.setZValue(2 if name == source else 1)

    def show_signals(self, signals_mm: dict[str, NDArray[np.float32]], rate_hz: int) -> None:
        """What has been rendered so far, from time 0. What lies in view is drawn at full detail."""
        low_s, high_s = self.times_s
        for name, signal in signals_mm.items():
            first = min(max(int(low_s * rate_hz), 0), len(signal))
            last = min(max(int(high_s * rate_hz) + 2, first), len(signal))
            if last > first:
                places, values = extremes(signal[first:last], COLUMNS)
                self._curves[name].setData((places + first) / rate_hz, values)
