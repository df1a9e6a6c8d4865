"""The waveform of the whole take at the listening point, with the playhead and the end of training."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent
from PySide6.QtWidgets import QWidget

from app.views import theme

COLUMNS = 1600
SEEK_STEP_S = 0.1


def extremes(signal: NDArray[np.float32], columns: int) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Lowest and highest value of each column, alternating: (places in samples, values) to draw as one line."""
    if len(signal) <= 2 * columns:
        return np.arange(len(signal), dtype=np.float64), signal
    edges = np.linspace(0, len(signal), columns, endpoint=False).astype(int)
    values = np.empty(2 * columns, np.float32)
    values[0::2] = np.minimum.reduceat(signal, edges)
    values[1::2] = np.maximum.reduceat(signal, edges)
    return np.repeat(edges.astype(np.float64), 2), values


class WaveformView(pg.PlotWidget):
    """Click to move the playhead; wheel to zoom in time, drag with the right button to pan."""

    seek_asked = Signal(float)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName("Waveform")
        self.setToolTip("Click moves the playhead; the wheel zooms in time; double-click shows all")
        self.setMinimumHeight(84)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        item = self.getPlotItem()
        item.setLabel("bottom", "time", units="s", siPrefix=False)
        item.getAxis("bottom").enableAutoSIPrefix(False)
        item.setLabel("left", "mm")
        item.showGrid(x=True, y=True, alpha=0.18)
        item.setMenuEnabled(False)
        item.hideButtons()
        item.setMouseEnabled(True, False)
        self._seconds = 1.0
        self._position_s = 0.0
        self._curves = {
            name: item.plot(pen=pg.mkPen(theme.SOURCE_COLOURS[name], width=1)) for name in ("truth", "model")
        }
        self._untrained = pg.LinearRegionItem(
            (1, 1), movable=False, brush=pg.mkBrush(theme.translucent(theme.WARNING, 18)), pen=pg.mkPen(None)
        )
        self._horizon = pg.InfiniteLine(
            1,
            pen=pg.mkPen(theme.WARNING, width=1, style=Qt.PenStyle.DashLine),
            label="end of training",
            labelOpts={"color": theme.WARNING, "position": 0.86, "anchors": [(0, 0.5), (0, 0.5)]},
        )
        self._playhead = pg.InfiniteLine(0, pen=pg.mkPen(theme.TEXT, width=1))
        for thing in (self._untrained, self._horizon, self._playhead):
            item.addItem(thing)
        self._untrained.setZValue(-10)
        self.set_heard("model")

    def set_take(self, seconds: float, horizon_s: float, peak_mm: float) -> None:
        """Axes for a take of `seconds` of a model that was trained for `horizon_s`."""
        self._seconds = seconds
        peak_mm = max(peak_mm, 1e-3)
        item = self.getPlotItem()
        item.setLimits(xMin=0, xMax=seconds, minXRange=0.002)
        item.setRange(xRange=(0, seconds), yRange=(-peak_mm, peak_mm), padding=0.02)
        self._untrained.setRegion((horizon_s, max(seconds, horizon_s)))
        self._horizon.setValue(horizon_s)
        inside = horizon_s < seconds
        self._horizon.setVisible(inside)
        self._untrained.setVisible(inside)
        for curve in self._curves.values():
            curve.setData([], [])

    def set_heard(self, source: str) -> None:
        for name, curve in self._curves.items():
            colour = theme.translucent(theme.SOURCE_COLOURS[name], 255 if name == source else 130)
            curve.setPen(pg.mkPen(colour, width=1))
            curve.setZValue(2 if name == source else 1)

    def show_signals(self, signals_mm: dict[str, NDArray[np.float32]], rate_hz: int) -> None:
        """What has been rendered so far, from time 0. What lies in view is drawn at full detail."""
        low_s, high_s = self.getPlotItem().viewRange()[0]
        for name, signal in signals_mm.items():
            first = min(max(int(low_s * rate_hz), 0), len(signal))
            last = min(max(int(high_s * rate_hz) + 2, first), len(signal))
            if last > first:
                places, values = extremes(signal[first:last], COLUMNS)
                self._curves[name].setData((places + first) / rate_hz, values)

    def show_playhead(self, position_s: float) -> None:
        if position_s != self._position_s:
            self._position_s = position_s
            self._playhead.setValue(position_s)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self._seek_to(event)
        else:
            super().mousePressEvent(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if event.buttons() & Qt.MouseButton.LeftButton:
            self._seek_to(event)
        else:
            super().mouseMoveEvent(event)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        self.getPlotItem().setXRange(0, self._seconds, padding=0)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        step = {Qt.Key.Key_Left: -SEEK_STEP_S, Qt.Key.Key_Right: SEEK_STEP_S}.get(Qt.Key(event.key()))
        if step is not None:
            self.seek_asked.emit(min(max(self._position_s + step, 0), self._seconds))
        elif event.key() == Qt.Key.Key_Home:
            self.seek_asked.emit(0.0)
        else:
            super().keyPressEvent(event)

    def _seek_to(self, event: QMouseEvent) -> None:
        place = self.getPlotItem().vb.mapSceneToView(self.mapToScene(event.position().toPoint())).x()
        self.seek_asked.emit(min(max(place, 0.0), self._seconds))
