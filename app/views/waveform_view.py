"""What is heard over the whole take, at the listening point."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtWidgets import QWidget

from app.shown import DEFAULT_SOURCES, ShownSource
from app.views.axis_label import UprightLabel
from app.views.curves import set_curves
from app.views.legend import Legend
from app.views.time_plot import TimePlot


def extremes(signal: NDArray[np.float32], columns: int) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """An upright stroke a column, from lowest to highest: (places in samples, values), pairs of ends.

    Each reaches as far as the next one's first sample, so that a steep flank has no gaps.
    """
    edges = np.linspace(0, len(signal), columns, endpoint=False).astype(int)
    meets = np.append(signal[edges[1:]], signal[-1])
    values = np.empty(2 * columns, np.float32)
    values[0::2] = np.minimum(np.minimum.reduceat(signal, edges), meets)
    values[1::2] = np.maximum(np.maximum.reduceat(signal, edges), meets)
    return np.repeat(edges.astype(np.float64), 2), values


class WaveformView(TimePlot):
    """One curve a source; the heard source is on top."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(
            "Waveform",
            "What the pick-up senses. Click moves the playhead; the wheel zooms in time, the right button pans;\n"
            "double-click shows all. Arrow keys move the playhead, + and − zoom",
            parent,
        )
        item = self.getPlotItem()
        item.showGrid(x=True, y=True, alpha=0.18)
        item.getAxis("left").enableAutoSIPrefix(False)
        self._horizon.label.setPosition(0.1)  # the legend has the upper edge
        self._label = UprightLabel(item)
        self._curves: dict[str, pg.PlotDataItem] = {}
        self.legend = Legend(self)
        self.set_sources(DEFAULT_SOURCES)
        self.set_scale(5.0, "displacement", "mm")

    def set_take(self, seconds: float, horizon_s: float) -> None:
        """A time axis for a take of `seconds` of a model that was trained for `horizon_s`."""
        self.set_times(seconds, horizon_s)
        for source in self._curves:
            self.clear_signal(source)

    def set_scale(self, full: float, quantity: str, unit: str) -> None:
        """The upright axis from −full to full in `unit`, which alone is told where there is little room."""
        self.getPlotItem().setYRange(-full, full, padding=0.02)
        self._label.set(f"{quantity} ({unit})", unit)

    @property
    def columns(self) -> int:
        """How many pixels of the screen a signal over all of the axis is drawn in."""
        return max(1, round(self.getPlotItem().vb.width() * self.devicePixelRatioF()))

    def set_sources(self, sources: tuple[ShownSource, ...], part: str = "") -> None:
        """What is drawn, the heard source on top; `part` says which part of the sound where it is not all."""
        set_curves(self.getPlotItem(), self._curves, sources, faint_alpha=130)
        self.legend.show_sources(sources, part)

    def show_signal(self, source: str, signal: NDArray[np.float32], rate_hz: int) -> None:
        """What there is so far, from time 0, in the unit of the axis. What lies in view is drawn at full detail."""
        low_s, high_s = self.times_s
        first = min(max(int(low_s * rate_hz), 0), len(signal))
        last = min(max(int(high_s * rate_hz) + 2, first), len(signal))
        in_view, columns = signal[first:last], round(self.columns * (last - first) / rate_hz / (high_s - low_s))
        # A smoothed line that goes to and fro within a pixel takes ten times as long as strokes of whole pixels,
        # and nothing else in this process runs meanwhile, not even what feeds the loudspeaker.
        if len(in_view) > columns > 0:
            places, values = extremes(in_view, columns)
            dense = {"connect": "pairs", "antialias": False}
        elif len(in_view):
            places, values = np.arange(len(in_view), dtype=np.float64), in_view
            dense = {"connect": "all", "antialias": True}
        else:
            self.clear_signal(source)
            return
        self._curves[source].setData((places + first) / rate_hz, values, **dense)

    def clear_signal(self, source: str) -> None:
        self._curves[source].setData([], [])
