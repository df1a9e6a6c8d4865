"""The whole string over time: displacement, or its error, as colour over time and position."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QRectF, Signal
from PySide6.QtWidgets import QWidget

from app.session.shown import readable_unit
from app.views import theme
from app.views.controls.parts import combo_box, lay_out_plot
from app.views.controls.readout import Readout
from app.views.controls.segments import SMALL, Segments
from app.views.plots.axis_label import UprightLabel, UprightTicks
from app.views.plots.colour_maps import displacement_map, error_map, magnitudes_of
from app.views.plots.time_plot import TimePlot

MM = 1000.0
GAINS = (1, 3, 10, 30, 100, 300, 1000, 3000, 10_000)
AUTO = 0  # the largest of them that keeps the typical displacement within the scale
QUANTITIES = (
    ("model", "Model", "Displacement of the model"),
    ("truth", "Truth", "Displacement of the truth"),
    ("error", "Error", "Model − truth"),
)
PLACES = (0, 0.25, 0.5, 0.75, 1)


class SpaceTimeView(QWidget):
    """Displacement and error keep a gain of their own. Positions are shares of the string's length.

    Colours show displacement with its sign, or its magnitude; colour bar and readout agree with them.
    """

    listening_point_moved = Signal(float)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.quantities = Segments("Shown", QUANTITIES)
        self.gains = combo_box(
            "Gain of the colours", [("auto gain", AUTO), *((f"gain {_times(gain)}", gain) for gain in GAINS)], AUTO
        )
        self.gains.setMinimumContentsLength(12)
        self.gains.setToolTip(
            "Gain of the colour scale; the colour bar shows the displacement.\n"
            "Auto fits most of the visible part; model and truth always have the same scale"
        )
        self.gains.setStyleSheet(f"{SMALL} padding-right: 0;")
        self.readout = Readout()
        self.plot = TimePlot(
            "Space–time",
            "Click moves the playhead here; with Shift also the listening point.\n"
            "The wheel zooms in time, down to single frames; the right button pans; double-click shows all.\n"
            "Arrow keys move the playhead, + and − zoom",
            shaded=False,
        )
        self._gain = {"displacement": AUTO, "error": AUTO}
        self._typical_mm = 1.0
        self._full_scale_mm = 1.0
        self._listen = 0.0
        item = self.plot.getPlotItem()
        item.setYRange(0, 1, padding=0)
        self._label = UprightLabel(item, ("position",))
        self._ticks = UprightTicks(item.getAxis("left"), item.vb)
        self._ticks.set((place, f"{place:g}") for place in PLACES)
        self._image = pg.ImageItem(axisOrder="row-major")
        item.addItem(self._image, ignoreBounds=True)
        self._listening = pg.InfiniteLine(0, angle=0, pen=pg.mkPen(theme.translucent(theme.TEXT, 90), width=1))
        self._listening.setZValue(15)
        item.addItem(self._listening, ignoreBounds=True)
        self._bar = pg.ColorBarItem(values=(-1, 1), width=10, colorMap=displacement_map(), interactive=False)
        self._bar.axis.enableAutoSIPrefix(False)
        self._bar.axis.setLabel("mm")
        self._bar.setImageItem(self._image, insert_in=item)
        self._signed = True
        self._map_shown = ("displacement", True)
        theme.changes.theme_changed.connect(self._take_theme)
        self.quantities.chosen.connect(self._choose_quantity)
        self.gains.activated.connect(self._choose_gain)
        self.plot.pointed.connect(lambda _, place: self.listening_point_moved.emit(min(max(place, 0.0), 1.0)))
        lay_out_plot(self, (self.quantities, self.gains), self.readout, self.plot)
        self.setTabOrder(self.gains, self.plot)

    @property
    def quantity(self) -> str:
        """ "model", "truth" or "error"."""
        return self.quantities.key

    @property
    def scale_mm(self) -> float:
        """The displacement at the end of the colour scale."""
        return self._full_scale_mm / (self._gain[self._kind] or self._fitting_gain)

    def set_take(self, seconds: float, horizon_s: float, full_scale_mm: float) -> None:
        """A new take; `full_scale_mm`: the displacement at the end of the colour scale at a gain of 1."""
        self._full_scale_mm = max(full_scale_mm, 1e-3)
        self.plot.set_times(seconds, horizon_s)
        self._image.clear()
        self._show_scale()

    def set_listening_point(self, listen: float) -> None:
        if listen != self._listen:
            self._listen = listen
            self._listening.setValue(listen)

    def show_picture(
        self,
        displacement_mm: NDArray[np.float32],
        start_s: float,
        stop_s: float,
        typical_mm: float,
        signed: bool = True,
    ) -> None:
        """Displacement (points, columns) of the times start_s … stop_s, or its magnitude where it is not `signed`.

        An automatic gain fits `typical_mm`.
        """
        self._typical_mm, self._signed = typical_mm, signed
        self._show_scale()
        half = 0.5 / (len(displacement_mm) - 1)  # the grid's points are the middles of their rows
        self._image.setImage(displacement_mm, autoLevels=False)
        self._image.setRect(QRectF(start_s, -half, stop_s - start_s, 1 + 2 * half))

    def tell(self, time_s: float, place: float, displacement_mm: float) -> None:
        """Writes in the readout what is drawn there, in the unit of the colour bar."""
        factor, unit = readable_unit(self.scale_mm / MM, "displacement")
        value = factor * displacement_mm / MM
        what = f"{value:+.4g} {unit}" if self._signed else f"peak {value:.4g} {unit}"
        self.readout.tell(f"{time_s:.4f} s   position {place:.2f}   {what}", what)

    def show_nothing(self) -> None:
        """Clears the picture: nothing is computed yet of the times in view."""
        self._image.clear()

    @property
    def _fitting_gain(self) -> int:
        return max((gain for gain in GAINS if gain * self._typical_mm <= self._full_scale_mm), default=GAINS[0])

    @property
    def _kind(self) -> str:
        return "error" if self.quantity == "error" else "displacement"

    def _take_theme(self) -> None:
        self._bar.setColorMap(_colour_map(*self._map_shown))

    def _choose_quantity(self) -> None:
        self.gains.setCurrentIndex(self.gains.findData(self._gain[self._kind]))
        self._show_scale()

    def _choose_gain(self) -> None:
        self._gain[self._kind] = self.gains.currentData()
        self._show_scale()

    def _show_scale(self) -> None:
        if self._map_shown != (self._kind, self._signed):
            self._map_shown = (self._kind, self._signed)
            self._bar.setColorMap(_colour_map(*self._map_shown))
        limits = (-self.scale_mm if self._signed else 0.0, self.scale_mm)
        if limits != self._bar.levels():
            factor, unit = readable_unit(self.scale_mm / MM, "displacement")
            self._bar.axis.setScale(factor / MM)
            self._bar.axis.setLabel(unit if self._signed else f"{unit}, peak")
            self._bar.setLevels(limits)
            self.gains.setItemText(0, f"auto gain {_times(self._fitting_gain)}")


def _times(gain: int) -> str:
    return f"× {gain}" if gain < 1000 else f"× {gain // 1000}k"


def _colour_map(kind: str, signed: bool) -> pg.ColorMap:
    made = error_map() if kind == "error" else displacement_map()
    return made if signed else magnitudes_of(made)
