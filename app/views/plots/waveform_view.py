"""What is heard over the whole take, at the listening point."""

from __future__ import annotations

import math

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtWidgets import QWidget

from app.session.shown import DEFAULT_SOURCES, ShownSource
from app.views.plots.axis_label import UprightLabel
from app.views.plots.curves import set_curves
from app.views.plots.legend import Legend
from app.views.plots.time_plot import TimePlot

FEW_PIXELS = 4


def extremes(signal: NDArray[np.float32], edges: NDArray[np.int64], around: int = 1) -> NDArray[np.float32]:
    """A vertical stroke for each column of frames, from its lowest to its highest value: ends (2 · columns,).

    Each reaches as far as the next one's first sample, so that a steep flank has no gaps.

    Args:
        signal: (frames,).
        edges: (columns + 1,), rising: the frames at which each column begins, and where the last ends.
        around: a stroke has the extremes of so many columns, centred on its own.
    """
    starts, meets = edges[:-1], signal[np.minimum(edges[1:], len(signal) - 1)]
    values = np.empty(2 * len(starts), np.float32)
    lowest = np.minimum(np.minimum.reduceat(signal[: edges[-1]], starts), meets)
    highest = np.maximum(np.maximum.reduceat(signal[: edges[-1]], starts), meets)
    values[0::2] = _neighbours(lowest, around).min(axis=-1)
    values[1::2] = _neighbours(highest, around).max(axis=-1)
    return values


def _neighbours(values: NDArray[np.float32], around: int) -> NDArray[np.float32]:
    """(values, around): each value with its neighbours."""
    before = (around - 1) // 2
    padded = np.pad(values, (before, around - 1 - before), mode="edge")
    return np.lib.stride_tricks.sliding_window_view(padded, around)


class WaveformView(TimePlot):
    """One curve a source; the heard source is on top."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(
            "Waveform",
            "Signal of the pick-up. Click moves the playhead; the wheel zooms in time, the right button pans;\n"
            "double-click shows all. Arrow keys move the playhead, + and − zoom",
            parent,
        )
        item = self.getPlotItem()
        item.showGrid(x=True, y=True, alpha=0.18)
        item.getAxis("left").enableAutoSIPrefix(False)
        self._horizon.label.setPosition(0.1)  # the legend has the upper edge
        self._label = UprightLabel(item)
        self._period_s = 0.0
        self._curves: dict[str, pg.PlotDataItem] = {}
        self.legend = Legend(self)
        self.set_sources(DEFAULT_SOURCES)
        self.set_scale(5.0, "displacement", "mm")

    def set_take(self, seconds: float, horizon_s: float, period_s: float = 0.0) -> None:
        """A new take, without signals yet; `period_s`: the period of its string, 0: not known."""
        self._period_s = period_s
        self.set_times(seconds, horizon_s)
        for source in self._curves:
            self.clear_signal(source)

    def set_scale(self, full: float, quantity: str, unit: str) -> None:
        """The vertical axis, from −full to full in `unit`."""
        self.getPlotItem().setYRange(-full, full, padding=0.02)
        self._label.set(f"{quantity} ({unit})", unit)

    def set_sources(self, sources: tuple[ShownSource, ...], part: str = "") -> None:
        """What is drawn, the heard source on top; `part` says which part of the sound where it is not all."""
        set_curves(self.getPlotItem(), self._curves, sources, faint_alpha=130)
        self.legend.show_sources(sources, part)

    def show_signal(self, source: str, signal: NDArray[np.float32], rate_hz: int) -> None:
        """The samples so far, (frames,) from time 0, in the unit of the axis; draws those in view, none left out."""
        low_s, high_s = self.times_s
        # A smoothed line that goes to and fro within a pixel takes ten times as long as a stroke for each, and a key
        # that is played waits for the painting.
        if (high_s - low_s) * rate_hz > self.columns:
            borders_s = np.linspace(low_s, high_s, self.columns + 1)
            edges = np.ceil(borders_s * rate_hz).astype(np.int64).clip(0, len(signal))
            there = np.flatnonzero(edges[1:] > edges[:-1])
            middles_s = (borders_s[there] + borders_s[there + 1]) / 2
            # Where a period is a few pixels wide, each stroke has the extremes of a whole one, or they would beat.
            pixels = self._period_s * self.columns / (high_s - low_s)
            around = math.ceil(pixels) if 0 < pixels < FEW_PIXELS else 1
            values = extremes(signal, edges[there[0] : there[-1] + 2], around) if len(there) else signal[:0]
            self._curves[source].setData(np.repeat(middles_s, 2), values, connect="pairs", antialias=False)
        else:
            first = min(max(int(low_s * rate_hz), 0), len(signal))
            last = min(max(int(high_s * rate_hz) + 2, first), len(signal))
            self._curves[source].setData(
                np.arange(first, last) / rate_hz, signal[first:last], connect="all", antialias=True
            )

    def clear_signal(self, source: str) -> None:
        self._curves[source].setData([], [])
