"""The whole string over time, as colour over time and position: displacement of a source, or the error."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QRectF

from app.analysis.space_time import Envelopes, Picture, motion_of, picture
from app.export.columns import Columns
from app.presets.library import Library
from app.rendering import SOURCES, BlowTake, Sounding, Take
from app.session.shown import readable_unit
from app.stage.session import Session
from app.views import theme
from app.views.controls.parts import SMALL, combo_box
from app.views.controls.segments import Segments
from app.views.plots.colour_maps import displacement_map, error_map, magnitudes_of
from app.views.plots.time_plot import TimePlot
from app.window.panels.time_panel import TimePanel

MM = 1000.0
GAINS = (1, 3, 10, 30, 100, 300, 1000, 3000, 10_000)
AUTO = 0  # stands for the largest gain that keeps the typical displacement within the scale
QUANTITIES = (
    ("model", "Model", "Displacement of the model"),
    ("truth", "Truth", "Displacement of the truth"),
    ("error", "Error", "Model − truth"),
)
PLACES = (0, 0.25, 0.5, 0.75, 1)


class SpaceTimePanel(TimePanel[Envelopes]):
    """Displacement and error keep a gain of their own. Positions are shares of the string's length.

    Colours show displacement with its sign, or its magnitude; colour bar and readout agree with them.
    """

    key = "space_time"
    title = "Space–time"
    help = (
        "Displacement of model or truth, or the error between them, over time (across) and position on the string "
        "(up). A click moves the playhead, with Shift the listening point too."
    )

    def __init__(self, session: Session, library: Library) -> None:
        tip = (
            "Click moves the playhead here; with Shift also the listening point.\n"
            "The wheel zooms in time, down to single frames; the right button pans; double-click shows all.\n"
            "Arrow keys move the playhead, + and − zoom"
        )
        super().__init__(session, library, TimePlot("Space–time", tip, shaded=False))
        self.quantities = Segments("Shown", QUANTITIES)
        gains = [("auto gain", AUTO), *((f"gain {_times(gain)}", gain) for gain in GAINS)]
        tip = (
            "Gain of the colour scale; the colour bar shows the displacement.\n"
            "Auto fits most of the visible part; model and truth always have the same scale"
        )
        self.gains = combo_box("Gain of the colours", gains, AUTO, tip, self._choose_gain)
        self.gains.setMinimumContentsLength(12)
        self.gains.setStyleSheet(f"{SMALL} padding-right: 0;")
        self._gain = {"displacement": AUTO, "error": AUTO}  # chosen: of GAINS, or AUTO
        self._typical_mm = 1.0  # 1.5-fold median, over the times in view, of the string's peak
        self._full_scale_mm = 1.0  # displacement at the end of the colours at a gain of 1: the pluck's amplitude
        self._picture: Picture | None = None  # what is drawn; None: nothing
        item = self.plot.getPlotItem()
        item.setYRange(0, 1, padding=0)
        self.plot.label.set("position")
        self.plot.ticks.set((place, f"{place:g}") for place in PLACES)
        self._image = pg.ImageItem(axisOrder="row-major")
        item.addItem(self._image, ignoreBounds=True)
        self._listening = pg.InfiniteLine(0, angle=0, pen=pg.mkPen(theme.translucent(theme.TEXT, 90), width=1))
        self._listening.setZValue(15)
        item.addItem(self._listening, ignoreBounds=True)
        self._bar = pg.ColorBarItem(values=(-1, 1), width=10, colorMap=displacement_map(), interactive=False)
        self._bar.axis.enableAutoSIPrefix(False)
        self._bar.axis.setLabel("mm")
        self._bar.setImageItem(self._image, insert_in=item)
        self._signed = True  # colours have the sign; False: magnitudes
        self._map_shown = ("displacement", True)  # the kind and sign that the colours are of
        theme.changes.theme_changed.connect(self._take_theme)
        self.quantities.chosen.connect(self._choose_quantity)
        self.plot.pointed.connect(lambda _, place: session.move_listening_point(min(max(place, 0.0), 1.0)))
        self._lay_out(self.quantities, self.gains)
        self.setTabOrder(self.gains, self.plot)

    @property
    def scale_mm(self) -> float:
        """The displacement at the end of the colour scale."""
        return self._full_scale_mm / (self._gain[self._kind] or self._fitting_gain)

    def choices_changed(self, names: frozenset[str]) -> None:
        if "ear" in names and self.session.choices.listen != self._listening.value():
            self._listening.setValue(self.session.choices.listen)

    def take_started(self, take: Take | BlowTake) -> None:
        super().take_started(take)
        assert isinstance(take, Take)  # it draws no drums
        self._picture = None
        self._full_scale_mm = max(take.pluck.amplitude_mm, 1e-3)  # at a gain of 1
        self._image.clear()
        self._show_scale()

    def _begin(self, take: Sounding) -> Envelopes:
        assert isinstance(take, Take)  # it draws no drums
        figures = Envelopes(take)
        self._keep_up(figures)
        return figures

    def _draw(self, figures: Envelopes) -> None:
        """Draw the times in view, where the view has changed or more is ready; show how fine the picture is."""
        quantity = self.quantities.key
        times_s = self.plot.times_s
        columns = self.plot.columns
        if not self._is_new(figures, figures.take.ready_frames, figures.ready, quantity, times_s, columns):
            return
        self._picture = seen = picture(figures, quantity, times_s, columns)
        if seen is None:  # nothing is computed yet of the times in view
            self._image.clear()
            return
        names = ("error",) if quantity == "error" else SOURCES  # the same scale for model and truth
        self._typical_mm = max(figures.typical_m(name, times_s) for name in names) * MM
        self._signed = seen.signed
        self._show_scale()
        half = 0.5 / (len(seen.displacement_m) - 1)  # the grid's points are the middles of their rows
        self._image.setImage(seen.displacement_m * MM, autoLevels=False)
        self._image.setRect(QRectF(seen.start_s, -half, seen.stop_s - seen.start_s, 1 + 2 * half))
        self.readout.rest(*_captions(seen))

    def columns(self) -> Columns | None:
        """The pictures in view, one a row."""
        if self._made is None:
            return None
        take, quantity = self._made.take, self.quantities.key
        frames = self.plot.frames_in_view(take.frames_hz, take.ready_frames)
        motion_m = motion_of(take, quantity, frames.start, frames.stop)
        places = np.linspace(0, 1, motion_m.shape[1])
        shapes = {f"{quantity} at {place:.6g} (m)": there for place, there in zip(places, motion_m.T, strict=True)}
        return Columns({"time (s)": np.array(frames) / take.frames_hz, **shapes})

    def _words(self, figures: Envelopes, time_s: float, place: float) -> Iterable[str]:
        here_m = self._picture.at(time_s, place) if self._picture is not None else None
        return [] if here_m is None else self._wordings(time_s, place, here_m)

    def _wordings(self, time_s: float, place: float, here_m: float) -> list[str]:
        """The time, the place and the displacement drawn there in the colour bar's unit; a long and a short wording.

        Args:
            place: share of the string's length, 0 … 1.
        """
        factor, unit = readable_unit(self.scale_mm / MM, "displacement")
        value_words = f"{factor * here_m:+.4g} {unit}" if self._signed else f"peak {factor * here_m:.4g} {unit}"
        return [f"{time_s:.4f} s   position {place:.2f}   {value_words}", value_words]

    @property
    def _fitting_gain(self) -> int:
        """The gain of AUTO: the largest with which the typical displacement is within the scale; at least 1."""
        return max((gain for gain in GAINS if gain * self._typical_mm <= self._full_scale_mm), default=GAINS[0])

    @property
    def _kind(self) -> str:
        """The key of `_gain`: model and truth share the one of displacement."""
        return "error" if self.quantities.key == "error" else "displacement"

    def _take_theme(self) -> None:
        self._bar.setColorMap(_colour_map(*self._map_shown))

    def _choose_quantity(self) -> None:
        self.gains.setCurrentIndex(self.gains.findData(self._gain[self._kind]))
        self._show_scale()

    def _choose_gain(self, gain: int) -> None:
        self._gain[self._kind] = gain
        self._show_scale()

    def _show_scale(self) -> None:
        """Fit colours, colour bar and the words of the automatic gain to the present scale."""
        if self._map_shown != (self._kind, self._signed):
            self._map_shown = (self._kind, self._signed)
            self._take_theme()
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
    colours = error_map() if kind == "error" else displacement_map()
    return colours if signed else magnitudes_of(colours)


def _captions(image: Picture) -> list[str]:
    """The caption that states what a column of the image holds, the longer wording first."""
    column_ms = 1000 * (image.stop_s - image.start_s) / image.displacement_m.shape[1]
    return {
        "frames": ["every frame"],
        "extremes": [f"extremes of {column_ms:.2g} ms", f"{column_ms:.2g} ms"],
        "envelope": [
            f"peaks of {column_ms:.2g} ms, without sign; zoom in for motion",
            f"peaks of {column_ms:.2g} ms",
        ],
    }[image.detail]
