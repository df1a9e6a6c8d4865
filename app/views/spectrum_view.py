"""The spectrum at the playhead: model and truth, dB against log frequency."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QObject, QPointF, Qt, Signal
from PySide6.QtWidgets import QWidget
from scipy.fft import rfft

from app.views import theme
from app.views.parts import combo_box, lay_out_plot
from app.views.readout import Readout
from app.views.segments import SMALL

FLOOR_DB, CEILING_DB = -130.0, 0.0
LOWEST_HZ = 50.0
WINDOW_S = 0.18
COLUMNS = 480
PADDING = 4  # times the window
AREA_STEP = 3  # columns
RANGES_DB = (60, 90, 130)


@dataclass(frozen=True)
class Analyser:
    """A Hann-windowed magnitude spectrum on `COLUMNS` logarithmic columns, 0 dB for a full-scale sine."""

    rate_hz: int

    @property
    def window_frames(self) -> int:
        """The power of two nearest to `WINDOW_S`."""
        return 2 ** round(math.log2(WINDOW_S * self.rate_hz))

    @cached_property
    def column_hz(self) -> NDArray[np.float64]:
        return np.geomspace(LOWEST_HZ, self.rate_hz / 2, COLUMNS)

    @cached_property
    def _window(self) -> NDArray[np.float32]:
        window = np.hanning(self.window_frames)
        return (window * 2 / window.sum()).astype(np.float32)

    @cached_property
    def _bins(self) -> NDArray[np.float64]:
        """The columns' places in the padded spectrum."""
        return self.column_hz * PADDING * self.window_frames / self.rate_hz

    @cached_property
    def _first_bins(self) -> NDArray[np.intp]:
        """Where columns are wider than bins: each one's first."""
        return np.concatenate([self._bins[:1], np.sqrt(self._bins[1:] * self._bins[:-1])]).astype(int)

    @cached_property
    def _wide(self) -> NDArray[np.bool_]:
        last = PADDING * self.window_frames // 2 + 1
        return np.diff(self._first_bins, append=last) > 1

    def level_db(self, signal: NDArray[np.float32]) -> NDArray[np.float64]:
        """Levels (COLUMNS,) of the first `window_frames` of a signal in units of full scale."""
        frames = self.window_frames
        block = np.zeros(frames, np.float32)
        block[: min(frames, len(signal))] = signal[:frames]
        magnitude = np.abs(rfft((block - block.mean()) * self._window, PADDING * frames))
        columns = np.interp(self._bins, np.arange(len(magnitude)), magnitude)
        # the loudest bin of a wide column, so that no partial falls between two
        loudest = np.maximum.reduceat(magnitude, self._first_bins)
        columns = np.maximum(columns, np.where(self._wide, loudest, 0))
        return np.maximum(20 * np.log10(columns + 1e-12), FLOOR_DB)


class SpectrumView(QWidget):
    """Two curves on one locked pair of axes; the heard source is on top. The mouse reads a frequency."""

    hovered = Signal(float)  # a frequency in Hz; not a number where the mouse has left

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setMinimumHeight(84)
        self.plot = pg.PlotWidget()
        self.plot.setAccessibleName("Spectrum")
        self.plot.setToolTip("The spectrum at the listening point, at the playhead; 0 dB is a sine of full scale")
        self.ranges = combo_box("Dynamic range", ((f"{db} dB", db) for db in RANGES_DB), RANGES_DB[-1])
        self.ranges.setToolTip("How far below full scale the axis reaches, the same for model and truth")
        self.ranges.setStyleSheet(SMALL)
        self.ranges.activated.connect(self._fit)
        self.readout = Readout()
        item = self.plot.getPlotItem()
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
        # an area of a third of the points, not smoothed: as a fill of the curve it takes longer than all else here
        brush = pg.mkBrush(theme.translucent(theme.TRUTH, 28))
        self._area = pg.PlotCurveItem(pen=None, brush=brush, fillLevel=FLOOR_DB, antialias=False)
        item.addItem(self._area)
        self._partial = pg.InfiniteLine(0, pen=pg.mkPen(theme.FAINT, width=1, style=Qt.PenStyle.DotLine))
        self._partial.hide()
        item.addItem(self._partial, ignoreBounds=True)
        self._levels_db: dict[str, NDArray[np.float64]] = {}
        self._analyser = Analyser(16_000)
        self.set_rate(16_000)
        self.set_heard("model")
        self.plot.viewport().installEventFilter(self)
        lay_out_plot(self, (self.ranges,), self.readout, self.plot)

    @property
    def analyser(self) -> Analyser:
        return self._analyser

    @property
    def range_db(self) -> int:
        return int(self.ranges.currentData())

    def set_rate(self, rate_hz: int) -> None:
        """Fits the frequency axis to a model's rate."""
        self._analyser = Analyser(rate_hz)
        self._levels_db = {}
        self._fit()

    def set_heard(self, source: str) -> None:
        for name, curve in self._curves.items():
            colour = theme.translucent(theme.SOURCE_COLOURS[name], 255 if name == source else 150)
            curve.setPen(pg.mkPen(colour, width=1))
            curve.setZValue(2 if name == source else 1)

    def show_signals(self, signals: dict[str, NDArray[np.float32]]) -> None:
        """Signals in units of full scale, at least a window each."""
        for name, signal in signals.items():
            self._levels_db[name] = self._analyser.level_db(signal)
            self._curves[name].setData(self._analyser.column_hz, self._levels_db[name])
        if "truth" in signals:
            tops_db = self._levels_db["truth"].reshape(-1, AREA_STEP).max(axis=1)
            middles = np.log10(self._analyser.column_hz[AREA_STEP // 2 :: AREA_STEP])
            self._area.setData(middles, tops_db, skipFiniteCheck=True)

    def levels_db(self, frequency_hz: float) -> dict[str, float]:
        """What is drawn at a frequency, by source."""
        column = int(np.abs(np.log(self._analyser.column_hz / frequency_hz)).argmin())
        return {name: float(levels[column]) for name, levels in self._levels_db.items()}

    def show_readout(self, text: str, partial_hz: float | None = None) -> None:
        """Text beside the axes, and a line at a partial."""
        self.readout.tell(text)
        self._partial.setVisible(partial_hz is not None)
        if partial_hz is not None:
            self._partial.setValue(math.log10(partial_hz))

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.MouseMove:
            place = event.position()  # type: ignore[attr-defined]
            self.hovered.emit(self._frequency_at(place))
        elif event.type() == QEvent.Type.Leave:
            self.hovered.emit(math.nan)
        return super().eventFilter(watched, event)

    def _frequency_at(self, place: QPointF) -> float:
        box = self.plot.getPlotItem().vb
        scene = self.plot.mapToScene(place.toPoint())
        inside = box.sceneBoundingRect().contains(scene)
        return float(10 ** box.mapSceneToView(scene).x()) if inside else math.nan

    def _fit(self) -> None:
        self.plot.getPlotItem().setRange(
            xRange=(math.log10(LOWEST_HZ), math.log10(self._analyser.rate_hz / 2)),
            yRange=(CEILING_DB - self.range_db, CEILING_DB),
            padding=0,
        )


_LABELLED_HZ = (50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000)
