"""The error of this pluck over time, as it is rendered: relative on a log axis, or in level."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import Qt

from app.export.columns import Columns
from app.presets import words
from app.presets.library import Library
from app.rendering import BlowTake, Sounding, Take
from app.stage.session import Session
from app.views import theme
from app.views.controls.parts import SMALL, tool_button
from app.views.controls.segments import Segments
from app.views.plots.time_plot import TimePlot
from app.window.panels.time_panel import TimePanel
from engine.compare.relative import ErrorWindows

LONG_S = 10.0  # that the button renders
QUANTITIES = (
    ("relative", "MAE and RMSE", "Relative to the truth, over all of the string, in windows of two periods"),
    ("level", "Level", "Level of the model relative to the truth, in dB"),
)
LOWEST_DECADE, HIGHEST_DECADE = -9, 4  # log₁₀ of errors; motions are kept in single precision, about 1e-7
LEVEL_SPANS_DB = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)


class ErrorTimePanel(TimePanel[ErrorWindows]):
    """Errors over time: relative ones as log₁₀, on an axis that grows by decades, or the model's level in dB.

    Dotted lines are the preset's stored errors in validation, as far as the end of the trained time.
    """

    of_strings = False
    key = "error_time"
    title = "Error over time"
    help = (
        "The model's error relative to the truth in windows of two periods, within the trained time and past it. "
        "One button renders ten seconds."
    )

    def __init__(self, session: Session, library: Library) -> None:
        tip = (
            "Click moves the playhead; the wheel zooms in time, the right button pans; double-click shows all.\n"
            "Arrow keys move the playhead, + and − zoom"
        )
        super().__init__(session, library, TimePlot("Error over time", tip))
        self.quantities = Segments("Error", QUANTITIES)
        self.longer = tool_button(
            f"to {LONG_S:g} s", f"Render {LONG_S:g} s", f"Render this pluck for {LONG_S:g} s, far past training"
        )
        self.longer.setStyleSheet(f"QToolButton {{{SMALL}}} QToolButton:disabled {{color: {theme.FAINT};}}")
        self.longer.clicked.connect(lambda: session.update(seconds=LONG_S))
        item = self.plot.getPlotItem()
        item.showGrid(x=True, y=True, alpha=0.18)
        colours = {"rmse": theme.MODEL, "mae": theme.DIFFERENCE, "level_db": theme.MODEL}
        self._curves = {name: item.plot(pen=pg.mkPen(colour, width=1)) for name, colour in colours.items()}
        dotted = {name: pg.mkPen(colours[name], width=1, style=Qt.PenStyle.DotLine) for name in ("rmse", "mae")}
        self._stored = {name: item.plot(pen=pen) for name, pen in dotted.items()}
        self._legend = item.addLegend(offset=(-8, 4))
        self._stored_errors: dict[str, float] = {}  # relative, "rmse" and "mae" of validation, as far as known
        self._measured: tuple[str, ...] = ("rmse", "mae")  # of a drum there is no mean of absolute errors
        self._range: tuple[float, float] | None = None  # ends of the axis: log₁₀ of errors, or dB; None: not set
        theme.changes.theme_changed.connect(self._show_legend)
        self.quantities.chosen.connect(self._choose)
        self._lay_out(self.quantities, self.longer)
        self._choose()

    def choices_changed(self, names: frozenset[str]) -> None:
        if "seconds" in names:
            self.longer.setEnabled(self.session.choices.seconds < LONG_S)

    def take_started(self, take: Take | BlowTake) -> None:
        """Clear the curves, and draw the preset's errors in validation as dotted lines; a drum has none."""
        super().take_started(take)
        self._measured = ("rmse",) if isinstance(take, BlowTake) else ("rmse", "mae")
        self._stored_errors = {}  # the model was validated on no drum
        if isinstance(take, Take):
            rmse = None if take.info.rel_mse is None else math.sqrt(take.info.rel_mse)
            errors = {"rmse": rmse, "mae": take.info.rel_mae}
            self._stored_errors = {name: error for name, error in errors.items() if error is not None}
        for curve in self._curves.values():
            curve.setData([], [])
        for name, line in self._stored.items():
            value = self._stored_errors.get(name, 0.0)
            level = math.log10(value) if value > 0 else math.nan
            line.setData([0, min(take.horizon_s, take.seconds)], [level, level])
        self._range = None
        self._fit([])
        self._show_legend()

    def _begin(self, take: Sounding) -> ErrorWindows:
        return take.error_course

    def _draw(self, figures: ErrorWindows) -> None:
        ready = figures.ready
        if ready and self._is_new(figures, ready, self.quantities.key):
            self.show_curves(
                figures.middle_s[:ready], {name: values[:ready] for name, values in figures.curves.items()}
            )

    def show_curves(self, time_s: NDArray[np.float64], curves: dict[str, NDArray[np.float64]]) -> None:
        """Draw the curves of the chosen quantity.

        Args:
            time_s: the middles of the windows, (windows,).
            curves: (windows,) each: relative errors "rmse" and, of a string, "mae"; "level_db".
        """
        if self._level:
            levels = {"level_db": curves["level_db"]}
        else:
            with np.errstate(divide="ignore"):  # no error at all lies below the axis
                levels = {name: np.log10(curves[name]) for name in ("rmse", "mae") if name in curves}
        for name, values in levels.items():
            self._curves[name].setData(time_s, np.where(np.isfinite(values), values, np.nan), connect="finite")
        self._fit(list(levels.values()))

    def columns(self) -> Columns | None:
        if self._made is None:
            return None
        middle_s, (low_s, high_s) = self._made.middle_s[: self._made.ready], self.plot.times_s
        seen = np.flatnonzero((low_s <= middle_s) & (middle_s <= high_s))
        return Columns({"time (s)": middle_s[seen], **{name: all_[seen] for name, all_ in self._made.curves.items()}})

    def _words(self, figures: ErrorWindows, time_s: float, place: float) -> Iterable[str]:
        window = int(time_s / figures.window_s)
        if not 0 <= window < figures.ready:
            return []
        point = {name: values[window] for name, values in figures.curves.items()}
        what = "   ".join(f"{name.upper()} {percent(point[name])}" for name in ("rmse", "mae") if name in point)
        if self._level:
            what = f"{point['level_db']:+.2f} dB" if math.isfinite(point["level_db"]) else "silent"
        return [f"{figures.middle_s[window]:.3f} s   {what}"]

    @property
    def _level(self) -> bool:
        return self.quantities.key == "level"

    def _choose(self) -> None:
        """Show the curves of the chosen quantity alone, on an axis of its own."""
        for name, curve in self._curves.items():
            curve.setVisible((name == "level_db") == self._level)
        for line in self._stored.values():
            line.setVisible(not self._level)
        self.plot.label.set(*(("level error (dB)", "dB") if self._level else ("relative error", "error")))
        self._range = None
        self._fit([])
        self._show_legend()

    def _fit(self, curves: list[NDArray[np.float64]]) -> None:
        """Widen the axis to whole decades, or a span in dB, around what is shown.

        For one take and quantity it never becomes narrower.

        Args:
            curves: (windows,) each, in the axis's unit: log₁₀ of relative errors, or dB.
        """
        finite = [values[np.isfinite(values)] for values in curves]
        values = np.concatenate([*finite, self._always_in_view()])
        if self._level:
            largest_db = 1.1 * float(np.abs(values).max())
            span = next((span for span in LEVEL_SPANS_DB if span >= largest_db), LEVEL_SPANS_DB[-1])
            limits = (-span, span)
        else:
            low = float(np.floor(values.min()).clip(LOWEST_DECADE, -1))
            limits = (low, float(np.ceil(values.max() - 0.25).clip(0, HIGHEST_DECADE)) + 0.25)
        if self._range is not None:
            limits = min(limits[0], self._range[0]), max(limits[1], self._range[1])
        if limits != self._range:
            self._range = limits
            self.plot.getPlotItem().setYRange(*limits, padding=0)
            self.plot.ticks.set(None if self._level else _decades(*limits), _between_decades(*limits))

    def _always_in_view(self) -> NDArray[np.float64]:
        """The values that the axis always holds: 0 dB; or log₁₀ of 1 %, of 100 % and of the stored errors."""
        if self._level:
            return np.zeros(1)
        levels = [math.log10(value) for value in self._stored_errors.values() if value > 0]
        return np.array([-2.0, 0.0, *levels])

    def _show_legend(self) -> None:
        """Name the curves of relative errors in the legend, and write the stored ones above the plot."""
        measured = () if self._level else self._measured
        self._legend.clear()
        self._legend.setLabelTextColor(theme.FAINT)
        for name in measured:
            self._legend.addItem(self._curves[name], name.upper())
        texts = [percent(self._stored_errors[name]) for name in measured if name in self._stored_errors]
        self.readout.rest(f"⋯ validation {', '.join(texts)}" if texts else "")


def percent(error: float) -> str:
    """A relative error with three digits."""
    return words.percent(error, 3)


def _decades(low: float, high: float) -> list[tuple[float, str]]:
    """The ticks of whole decades from `low` to `high`, log₁₀ of errors: each with its words in %."""
    return [(d, f"{100 * 10.0**d:.{max(0, -2 - d)}f} %") for d in range(math.ceil(low), math.floor(high) + 1)]


def _between_decades(low: float, high: float) -> list[float]:
    return [d + math.log10(n) for d in range(math.floor(low), math.ceil(high)) for n in range(2, 10)]
