"""The spectrum of what is heard at the playhead: level in dB over the logarithm of frequency."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QObject, QPointF, Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QWidget

from app.session.shown import DEFAULT_SOURCES, ShownSource
from app.views import theme
from app.views.controls.parts import combo_box, faint, lay_out_plot
from app.views.controls.readout import Readout
from app.views.controls.segments import SMALL
from app.views.plots.axis_label import UprightLabel, fit_foot
from app.views.plots.curves import set_curves
from app.views.plots.frequency_axis import LOWEST_HZ, RANGES_DB, frequency_ticks
from app.views.plots.kept_axes import keep_axes
from app.views.plots.legend import Legend

FLOOR_DB, CEILING_DB = -130.0, 0.0
WINDOW_S = 0.18
COLUMNS = 480
PADDING = 4  # length of the transform, in windows
AREA_STEP = 3  # columns to a point of the filled area


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
        """(COLUMNS,), from LOWEST_HZ to half the rate."""
        return np.geomspace(LOWEST_HZ, self.rate_hz / 2, COLUMNS)

    @cached_property
    def _window(self) -> NDArray[np.float32]:
        window = np.hanning(self.window_frames)
        return (window * 2 / window.sum()).astype(np.float32)

    @cached_property
    def _bins(self) -> NDArray[np.float64]:
        """The columns' places in the padded spectrum, in bins."""
        return self.column_hz * PADDING * self.window_frames / self.rate_hz

    @cached_property
    def _first_bins(self) -> NDArray[np.intp]:
        """The first bin of each column, where columns are wider than bins."""
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
        magnitude = np.abs(np.fft.rfft((block - block.mean()) * self._window, PADDING * frames))
        columns = np.interp(self._bins, np.arange(len(magnitude)), magnitude)
        # the loudest bin of a wide column, so that no partial falls between two
        loudest = np.maximum.reduceat(magnitude, self._first_bins)
        columns = np.maximum(columns, np.where(self._wide, loudest, 0))
        return np.maximum(20 * np.log10(columns + 1e-12), FLOOR_DB)


@lru_cache(maxsize=4)
def analyser_at(rate_hz: int) -> Analyser:
    """The analyser of a rate; it is kept, with its window and columns."""
    return Analyser(rate_hz)


class SpectrumView(QWidget):
    """What the slots hold, on the same axes; the heard source is on top. The mouse reads a frequency."""

    hovered = Signal(float)  # a frequency in Hz; NaN where the mouse has left

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setMinimumHeight(84)
        self.plot = pg.PlotWidget()
        self.plot.setAccessibleName("Spectrum")
        self.plot.setToolTip(
            "At the listening point and the playhead; 0 dB is a sine of the amplitude that the axis names"
        )
        self.ranges = combo_box("Dynamic range", ((f"{db} dB", db) for db in RANGES_DB), RANGES_DB[-1])
        self.ranges.setToolTip("How far below full scale the axis reaches, the same for every source")
        self.ranges.setStyleSheet(SMALL)
        self.ranges.activated.connect(self._fit)
        self.readout = Readout()
        item = self.plot.getPlotItem()
        item.setLogMode(x=True)
        item.setLabel("bottom", "frequency (Hz)")
        self._label = UprightLabel(item)
        item.showGrid(x=True, y=True, alpha=0.18)
        keep_axes(item)
        item.setMenuEnabled(False)
        item.hideButtons()
        item.setMouseEnabled(False, False)
        item.getAxis("bottom").setTicks([frequency_ticks()])
        item.getAxis("bottom").enableAutoSIPrefix(False)
        self._curves: dict[str, pg.PlotDataItem] = {}
        # slot B's, of a third of the points and not smoothed: to fill the curve itself takes longer than all else
        self._area = pg.PlotCurveItem(pen=None, fillLevel=FLOOR_DB, antialias=False)
        self._area_of: str | None = None
        item.addItem(self._area)
        self.legend = Legend(self.plot)
        self._partial = pg.InfiniteLine(0, pen=pg.mkPen(theme.FAINT, width=1, style=Qt.PenStyle.DotLine))
        self._partial.hide()
        item.addItem(self._partial, ignoreBounds=True)
        self._levels_db: dict[str, NDArray[np.float64]] = {}
        self._analysers: dict[str, Analyser] = {}  # by source, for they have rates of their own
        self._analyser = analyser_at(16_000)
        self.set_sources(DEFAULT_SOURCES)
        self.set_full_scale("10 mm")
        self._fit()
        self.plot.viewport().installEventFilter(self)
        lay_out_plot(self, (faint("range"), self.ranges), self.readout, self.plot)

    @property
    def range_db(self) -> int:
        return int(self.ranges.currentData())

    def set_rate(self, rate_hz: int) -> None:
        """Fits the frequency axis to a rate: the highest of what is drawn."""
        if rate_hz != self._analyser.rate_hz:
            self._analyser = analyser_at(rate_hz)
            self._fit()

    def set_full_scale(self, words: str) -> None:
        """The amplitude of the sine that is 0 dB, in words."""
        self._label.set(f"dB re {words}", "dB")

    def set_sources(self, sources: tuple[ShownSource, ...], part: str = "") -> None:
        """As `WaveformView.set_sources`; slot B's curve is filled."""
        set_curves(self.plot.getPlotItem(), self._curves, sources, faint_alpha=150)
        self._area_of = next((s.source for s in sources if "B" in s.slots and len(sources) > 1), None)
        if self._area_of:
            hue = theme.SOURCE_COLOURS[theme.source_kind(self._area_of)]
            self._area.setBrush(pg.mkBrush(theme.translucent(hue, 28)))
        self._levels_db = {name: levels for name, levels in self._levels_db.items() if name in self._curves}
        self.legend.show_sources(sources, part)

    def show_signal(self, source: str, signal: NDArray[np.float32], analyser: Analyser) -> None:
        """Draws the spectrum of a window of signal, (frames,), in units of full scale."""
        levels = analyser.level_db(signal)
        self._levels_db[source], self._analysers[source] = levels, analyser
        self._curves[source].setData(analyser.column_hz, levels)
        if source == self._area_of:
            tops_db = levels.reshape(-1, AREA_STEP).max(axis=1)
            middles = np.log10(analyser.column_hz[AREA_STEP // 2 :: AREA_STEP])
            self._area.setData(middles, tops_db, skipFiniteCheck=True)

    def clear_signal(self, source: str) -> None:
        self._levels_db.pop(source, None)
        self._curves[source].setData([], [])
        if source == self._area_of:
            self._area.setData([], [])

    def levels_db(self, frequency_hz: float) -> dict[str, float]:
        """The levels drawn at a frequency, by source, without sources whose rate does not reach it."""
        levels_db = {}
        for source, levels in self._levels_db.items():
            analyser = self._analysers[source]
            if frequency_hz <= analyser.rate_hz / 2:
                column = int(np.abs(np.log(analyser.column_hz / frequency_hz)).argmin())
                levels_db[source] = float(levels[column])
        return levels_db

    def show_readout(self, text: str, partial_hz: float | None = None) -> None:
        """Text above the plot, and a line at a partial; None: no line."""
        self.readout.tell(text)
        self._partial.setVisible(partial_hz is not None)
        if partial_hz is not None:
            self._partial.setValue(math.log10(partial_hz))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        fit_foot(self.plot)

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
