"""The error of this pluck over time: relative on a log axis, or in level."""

from __future__ import annotations

import math

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QWidget

from app.views import theme
from app.views.controls.parts import lay_out_plot, tool_button
from app.views.controls.readout import Readout
from app.views.controls.segments import SMALL, Segments
from app.views.plots.axis_label import UprightLabel, UprightTicks
from app.views.plots.time_plot import TimePlot

LONG_S = 10.0
QUANTITIES = (
    ("relative", "MAE and RMSE", "Relative to the truth, over all of the string, in windows of two periods"),
    ("level", "Level", "Level of the model relative to the truth, in dB"),
)
LOWEST_DECADE, HIGHEST_DECADE = -9, 4  # motions are kept in single precision, about 1e-7
LEVEL_SPANS_DB = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)


class ErrorTimeView(QWidget):
    """Curves are given whole, as far as they are computed; the axis grows with them by decades."""

    longer_asked = Signal()
    quantity_changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.quantities = Segments("Error", QUANTITIES)
        self.longer = tool_button(
            f"to {LONG_S:g} s", f"Render {LONG_S:g} s", f"Render this pluck for {LONG_S:g} s, far past training"
        )
        self.longer.setStyleSheet(f"QToolButton {{{SMALL}}} QToolButton:disabled {{color: {theme.FAINT};}}")
        self.longer.clicked.connect(self.longer_asked)
        self.readout = Readout()
        self.plot = TimePlot(
            "Error over time",
            "Click moves the playhead; the wheel zooms in time, the right button pans; double-click shows all.\n"
            "Arrow keys move the playhead, + and − zoom",
        )
        item = self.plot.getPlotItem()
        item.getAxis("left").enableAutoSIPrefix(False)
        self._label = UprightLabel(item)
        self._ticks = UprightTicks(item.getAxis("left"), item.vb)
        item.showGrid(x=True, y=True, alpha=0.18)
        self._curves = {
            "rmse": item.plot(pen=pg.mkPen(theme.MODEL, width=1)),
            "mae": item.plot(pen=pg.mkPen(theme.DIFFERENCE, width=1)),
            "level_db": item.plot(pen=pg.mkPen(theme.MODEL, width=1)),
        }
        dotted = Qt.PenStyle.DotLine
        self._stored = {
            "rmse": item.plot(pen=pg.mkPen(theme.MODEL, width=1, style=dotted)),
            "mae": item.plot(pen=pg.mkPen(theme.DIFFERENCE, width=1, style=dotted)),
        }
        self.readout.setTextFormat(Qt.TextFormat.AutoText)  # a legend in colours
        self._stored_errors: dict[str, float] = {}
        self._horizon_s = 1.0
        self._range: tuple[float, float] | None = None
        theme.changes.theme_changed.connect(self._tell_legend)
        self.quantities.chosen.connect(self._choose)
        lay_out_plot(self, (self.quantities, self.longer), self.readout, self.plot)
        self._choose()

    @property
    def quantity(self) -> str:
        """ "relative" or "level"."""
        return self.quantities.key

    def set_seconds(self, seconds: float) -> None:
        """The present duration; from `LONG_S` on the button is disabled."""
        self.longer.setEnabled(seconds < LONG_S)

    def set_take(self, seconds: float, horizon_s: float, stored: dict[str, float]) -> None:
        """A new take, without curves yet.

        `stored`: the preset's relative validation errors "rmse" and "mae", as far as it has them.
        """
        self._horizon_s, self._stored_errors = horizon_s, stored
        self.plot.set_times(seconds, horizon_s)
        for curve in self._curves.values():
            curve.setData([], [])
        for name, line in self._stored.items():
            value = stored.get(name, 0.0)
            level = math.log10(value) if value > 0 else math.nan
            line.setData([0, min(horizon_s, seconds)], [level, level])
        self._range = None
        self._fit([])
        self._tell_legend()

    def show_curves(self, time_s: NDArray[np.float64], curves: dict[str, NDArray[np.float64]]) -> None:
        """Relative errors "rmse" and "mae", and "level_db", (windows,) each at `time_s`."""
        if self.quantity == "level":
            drawn = {"level_db": curves["level_db"]}
        else:
            with np.errstate(divide="ignore"):  # no error at all lies below the axis
                drawn = {name: np.log10(curves[name]) for name in ("rmse", "mae")}
        for name, values in drawn.items():
            self._curves[name].setData(time_s, np.where(np.isfinite(values), values, np.nan), connect="finite")
        self._fit(list(drawn.values()))

    def _choose(self) -> None:
        level = self.quantity == "level"
        for name, curve in self._curves.items():
            curve.setVisible((name == "level_db") == level)
        for line in self._stored.values():
            line.setVisible(not level)
        self._label.set(*(("level error (dB)", "dB") if level else ("relative error", "error")))
        self._range = None
        self._fit([])
        self._tell_legend()
        self.quantity_changed.emit()

    def _fit(self, shown: list[NDArray[np.float64]]) -> None:
        """Widens the axis to whole decades, or a span in dB, around what is shown."""
        finite = [values[np.isfinite(values)] for values in shown]
        values = np.concatenate([*finite, *self._always_in_view()])
        item = self.plot.getPlotItem()
        if self.quantity == "level":
            largest_db = 1.1 * float(np.abs(values).max())
            span = next((span for span in LEVEL_SPANS_DB if span >= largest_db), LEVEL_SPANS_DB[-1])
            wanted = (-span, span)
        else:
            low = float(np.floor(values.min()).clip(LOWEST_DECADE, -1))
            wanted = (low, float(np.ceil(values.max() - 0.25).clip(0, HIGHEST_DECADE)) + 0.25)
        if self._range is not None:
            wanted = min(wanted[0], self._range[0]), max(wanted[1], self._range[1])
        if wanted != self._range:
            self._range = wanted
            item.setYRange(*wanted, padding=0)
            level = self.quantity == "level"
            self._ticks.set(None if level else _decades(*wanted), _between_decades(*wanted))

    def _always_in_view(self) -> list[NDArray[np.float64]]:
        if self.quantity == "level":
            return [np.zeros(1)]
        stored = [math.log10(value) for value in self._stored_errors.values() if value > 0]
        return [np.array([-2.0, 0.0, *stored])]

    def _tell_legend(self) -> None:
        if self.quantity == "level":
            self.readout.rest("")
            return
        drawn = (("rmse", theme.MODEL), ("mae", theme.DIFFERENCE))
        text = "&nbsp;&nbsp;".join(f"<span style='color:{colour}'>— {name.upper()}</span>" for name, colour in drawn)
        stored = [percent(self._stored_errors[name]) for name, _ in drawn if name in self._stored_errors]
        self.readout.rest(f"{text}&nbsp;&nbsp; ⋯ validation {', '.join(stored)}" if stored else text)


def percent(error: float) -> str:
    """A relative error with three digits."""
    return f"{100 * error:.3g} %"


def _decades(low: float, high: float) -> list[tuple[float, str]]:
    return [(d, f"{100 * 10.0**d:g} %") for d in range(math.ceil(low), math.floor(high) + 1)]


def _between_decades(low: float, high: float) -> list[float]:
    return [d + math.log10(n) for d in range(math.floor(low), math.ceil(high)) for n in range(2, 10)]
