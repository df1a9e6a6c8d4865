"""The eigenvalues that the chosen preset learned, with the string's own: frequency and decay time, or complex plane.

Amber rings are learned, blue dots the string's: a dot within its ring is a mode well learned. The values of the point
under the mouse are written above. A click, or Enter on the point chosen by the arrow keys, solos its mode.
"""

from __future__ import annotations

import math

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, Qt, Signal
from PySide6.QtGui import QGuiApplication, QKeyEvent, QMouseEvent

from app.analysis.poles import PoleFigure, Poles, pole_figure
from app.export.columns import Columns
from app.presets.library import Library
from app.rendering.subject import Subject, load_subject
from app.session.slots import subject_of
from app.stage.session import Session
from app.views import theme
from app.views.controls.parts import ENTER_KEYS, combo_box, lay_out_view
from app.views.plots.plot import Plot
from app.window.panels.base import ComputedPanel, Moment

NEAR_PIXELS = 16  # within which a point is pointed at
CLOSER_PIXELS = 3  # that a point of the string must be nearer than a learned one
SHORTEST_S, LONGEST_S = 1e-3, 100.0  # of the axis of decay times
_LABELLED_S = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)
AXES = {"musical": "Frequency and decay", "complex": "Complex plane"}

Array = NDArray[np.float64]


class EigenvaluesPanel(ComputedPanel):
    key = "eigenvalues"
    title = "Eigenvalues"
    help = (
        "The model's learned eigenvalues beside the string's own: as frequency and T60, or on the complex "
        "plane. A click solos that mode, Esc plays all modes."
    )

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library, "This preset cannot be read")
        self._figure: PoleFigure | None = None  # None: not computed yet
        self._shown = np.zeros(0, np.int64)  # indices of the learned points of the chosen layer
        axes, tip = [(text, key) for key, text in AXES.items()], "Frequency and decay time, or the complex plane"
        self._axes = combo_box("Axes", axes, tip=tip, picked=lambda _: self._draw())
        tip = "Which layer's eigenvalues are shown"
        self._layer = combo_box("Layer", [], tip=tip, picked=lambda _: self._draw())
        self._layer.hide()
        self.plane = self.figure = _Plane()
        self.plane.pointed.connect(self._show_values)
        self.plane.taken.connect(lambda point: self.solo(int(self._modes[point])))
        self.plane.escaped.connect(lambda: self.solo(0))
        theme.changes.theme_changed.connect(self._take_theme)
        self.background.finished.connect(self._show_figure)
        lay_out_view(self, (self._axes, self._layer), self._words, (), self.plane)

    def choices_changed(self, names: frozenset[str]) -> None:
        if "solo" in names:
            self._draw(keep_view=True)

    def show_moment(self, moment: Moment) -> None:
        if not moment.playing or self._asked is None:  # keys may change the string many times a second
            super().show_moment(moment)

    def _wanted(self) -> Subject | None:
        entry = self.library.find(self.session.choices.preset)
        return None if entry is None else subject_of(self.session.choices, entry.path)

    def _clear(self) -> None:
        self._figure = None
        self._layer.hide()
        self._draw()

    def _begin(self) -> None:
        entry = self.library.find(self.session.choices.preset)
        if entry is not None:
            subject = subject_of(self.session.choices, entry.path)
            self._say("Reading the preset …")
            self.compute(lambda job: pole_figure(load_subject(subject)), [entry.info])

    def _show_figure(self, figure: PoleFigure) -> None:
        """Show the eigenvalues that were computed, and a list of layers where there are several."""
        if self._layer.count() != figure.layers + 1:
            self._layer.clear()
            for layer in range(figure.layers):
                self._layer.addItem("First layer" if layer == 0 else f"Layer {layer + 1}", layer)
            self._layer.addItem("All layers", None)
        self._layer.setVisible(figure.layers > 1)
        self._figure = figure
        self._draw()

    def _take_theme(self) -> None:
        self._draw(keep_view=True)  # points have pens and brushes of their own

    def columns(self) -> Columns | None:
        """The shown points, the learned ones first."""
        if self._figure is None:
            return None
        learned, string, shown = self._figure.learned, self._figure.string, self._shown
        names = ("layer", "mode", "folded_hz", "mode_hz", "cents", "t60_s", "log")
        points = {name: np.concatenate([getattr(learned, name)[shown], getattr(string, name)]) for name in names}
        log = points.pop("log")
        kind = ["learned"] * len(shown) + ["string"] * len(string)
        return Columns({"kind": kind, **points, "decay (1/sample)": -log.real, "angle (rad/sample)": log.imag})

    @property
    def _modes(self) -> NDArray[np.int64]:
        """The modes of all points that are shown, the learned ones first."""
        assert self._figure is not None
        return np.concatenate([self._figure.learned.mode[self._shown], self._figure.string.mode])

    def _draw(self, keep_view: bool = False) -> None:
        """Draw the points of the chosen layer on the chosen axes; `keep_view`: without zooming to all of them."""
        figure, solo = self._figure, self.session.choices.solo
        if figure is None:
            self.plane.clear_points()
            return
        layer = self._layer.currentData() if figure.layers > 1 else None
        of_layer = np.ones(len(figure.learned), bool) if layer is None else figure.learned.layer == layer
        self._shown = np.nonzero(of_layer)[0]
        musical = self._axes.currentData() == "musical"
        place = _musical_places if musical else _complex_places
        learned, string = place(figure.learned)[self._shown], place(figure.string)
        first_layer = figure.learned.layer[self._shown] == (layer or 0)
        self.plane.show_points(learned, first_layer, string, self._modes == solo if solo else None)
        if not keep_view:
            self.plane.set_axes(musical, figure.rate_hz)
        self._words.rest(f"Mode {solo} is soloed; Esc plays all modes" if solo else figure.note)
        self._show_values(-1)

    def _show_values(self, point: int) -> None:
        """Write the values of a point above the plane; -1: none is pointed at."""
        figure = self._figure
        self._words.report(*(self._describe(figure, point) if figure is not None and point >= 0 else ("",)))

    def _describe(self, figure: PoleFigure, point: int) -> list[str]:
        """The description of a point in several wordings, the longest first.

        Args:
            point: index among all points that are shown, the learned ones first, as in `_modes`.
        """
        count = len(self._shown)
        learned = point < count
        poles, place = (figure.learned, self._shown[point]) if learned else (figure.string, point - count)
        mode = int(poles.mode[place])
        name, short = ("Learned, nearest to", "Learned,") if learned else ("The string’s", "String’s")
        pitch = f"{poles.mode_hz[place]:.1f} Hz"
        folded_hz = poles.folded_hz[place]
        folded = f" (heard at {folded_hz:.0f} Hz)" if folded_hz < poles.mode_hz[place] - 0.1 else ""
        decay = f"T60 {_t60_text(poles.t60_s[place])}"
        if not learned:
            return [f"{name} mode {mode}:  {pitch}{folded},  {decay}", f"{short} mode {mode}:  {pitch},  {decay}"]
        off, string = f"{poles.cents[place]:+.1f} cents", f"(string {_t60_text(figure.string.t60_s[mode - 1])})"
        layer = f",  layer {figure.learned.layer[place] + 1}" if figure.layers > 1 else ""
        return [
            f"{name} mode {mode}:  {pitch}{folded},  {off},  {decay} {string}{layer}",
            f"{short} mode {mode}:  {pitch},  {off},  {decay} {string}",
            f"{mode}:  {pitch},  {off},  {decay} {string}",
            f"{mode}:  {off},  {decay}",
        ]


def _musical_places(poles: Poles) -> Array:
    """The places (points, 2): frequency in Hz, and log₁₀ of T60 in s, limited to the axis."""
    return np.stack([poles.folded_hz, np.log10(np.clip(poles.t60_s, SHORTEST_S, LONGEST_S))], axis=1)


def _complex_places(poles: Poles) -> Array:
    values = np.exp(poles.log)
    return np.stack([values.real, values.imag], axis=1)


def _t60_text(t60_s: float) -> str:
    return "∞: it grows" if math.isinf(t60_s) else f"{t60_s:.3g} s"


class _Plane(Plot):
    """The points: wheel zooms, drag pans, double-click shows all, a click takes a point."""

    pointed = Signal(int)  # the number of a point, the learned ones first; -1: none
    taken = Signal(int)
    escaped = Signal()
    KEPT_KEYS = (*ENTER_KEYS, Qt.Key.Key_Escape)

    def __init__(self) -> None:
        super().__init__(
            "Plane of eigenvalues",
            "Amber rings: learned; blue dots: the string's own. Click or Enter: hear this mode alone, again for all\n"
            "Arrow keys go from point to point; the wheel zooms, double-click shows all",
        )
        self.hovered.connect(self._point_near)
        item = self.getPlotItem()
        item.showGrid(x=True, y=True, alpha=0.18)
        turn = np.linspace(0, np.pi, 721)
        self._circle = item.plot(np.cos(turn), np.sin(turn), pen=pg.mkPen(theme.FAINT, width=1))
        self._string = pg.ScatterPlotItem(symbol="o", size=6, pen=None)
        self._learned = pg.ScatterPlotItem(symbol="o", size=13, brush=None)
        self._ring = pg.ScatterPlotItem(symbol="o", size=21, pen=pg.mkPen(theme.TEXT, width=1), brush=None)
        for layer in (self._learned, self._string, self._ring):
            item.addItem(layer)
        self._places = np.empty((0, 2))  # (points, 2) on the axes, the learned ones first
        self._learned_count = 0
        self._at = -1  # the point that is pointed at; -1: none
        self._pressed: QPointF | None = None  # where a mouse button went down, in pixels

    def clear_points(self) -> None:
        self._places, self._at = np.empty((0, 2)), -1
        for layer in (self._learned, self._string, self._ring):
            layer.setData([], [])

    def show_points(
        self, learned: Array, first_layer: NDArray[np.bool_], string: Array, alone: NDArray[np.bool_] | None
    ) -> None:
        """Draw the points.

        Args:
            learned, string: places on the axes, (points, 2) each.
            first_layer: (learned points,): drawn in amber; the others are faint.
            alone: (all points,), the learned ones first: of the soloed mode, others are dimmed. None: no mode is
                soloed.
        """
        self._places, self._at = np.concatenate([learned, string]), -1
        self._learned_count = len(learned)
        self._ring.setData([], [])
        bright = np.ones(len(self._places), bool) if alone is None else alone
        pens = [
            pg.mkPen(
                theme.translucent(theme.MODEL if first else theme.FAINT, 230 if loud else 60), width=2 if first else 1
            )
            for first, loud in zip(first_layer, bright, strict=False)
        ]
        brushes = [pg.mkBrush(theme.translucent(theme.TRUTH, 255 if loud else 80)) for loud in bright[len(learned) :]]
        self._learned.setData(x=learned[:, 0], y=learned[:, 1], pen=pens)
        self._string.setData(x=string[:, 0], y=string[:, 1], brush=brushes)

    def set_axes(self, musical: bool, rate_hz: int) -> None:
        """Frequency in Hz against decay time, or the upper half of the complex plane; all points in view."""
        item = self.getPlotItem()
        self._circle.setVisible(not musical)
        item.setAspectLocked(not musical)
        if musical:
            item.setLabel("bottom", "frequency (Hz)")
            self.label.set("decay: T60 (s)", "T60 (s)", "s")
            item.setLimits(xMin=-0.02 * rate_hz, xMax=0.52 * rate_hz)
        else:
            item.setLabel("bottom", "Re λ")
            self.label.set("Im λ")
            item.setLimits(xMin=None, xMax=None)
        self.ticks.set([(math.log10(s), f"{s:g}") for s in _LABELLED_S] if musical else None)
        self.fit_foot()
        self._musical, self._rate_hz = musical, rate_hz
        self.show_all()

    def show_all(self) -> None:
        """Zoom so that all points are in view."""
        if not len(self._places):
            return
        item, places = self.getPlotItem(), self._places
        if self._musical:
            low, high = places[:, 1].min() - 0.15, places[:, 1].max() + 0.15
            item.setRange(
                xRange=(0, min(1.06 * places[:, 0].max(), 0.51 * self._rate_hz)), yRange=(low, high), padding=0
            )
        else:
            (left, bottom), (right, top) = places.min(0), places.max(0)
            item.setRange(xRange=(left, right), yRange=(bottom, top), padding=0.06)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._pressed = event.position()
        super().mousePressEvent(event)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Take the point that was clicked; a press that moved by 4 pixels or more is a drag."""
        super().mouseReleaseEvent(event)
        pressed, self._pressed = self._pressed, None
        if event.button() == Qt.MouseButton.LeftButton and pressed is not None:
            still = (event.position() - pressed).manhattanLength() < 4
            if still and (point := self._nearest(self.place_at(event.position()))) >= 0:
                self._point_at(point)
                self.taken.emit(point)

    def _point_near(self, x: float, y: float) -> None:
        if not QGuiApplication.mouseButtons():
            point = self._nearest(QPointF(x, y))
            self.setCursor(Qt.CursorShape.PointingHandCursor if point >= 0 else Qt.CursorShape.ArrowCursor)
            self._point_at(point)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        if self._nearest(self.place_at(event.position())) < 0:
            self.show_all()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Point at the next or the previous point by an arrow key; Enter takes it, Escape plays all modes."""
        step = {Qt.Key.Key_Left: -1, Qt.Key.Key_Right: 1}.get(Qt.Key(event.key()))
        if step is not None and len(self._places):
            order = np.lexsort((self._places[:, 1], self._places[:, 0] if self._musical else -self._places[:, 0]))
            here = int(np.nonzero(order == self._at)[0][0]) if self._at >= 0 else (-1 if step > 0 else 0)
            self._point_at(int(order[(here + step) % len(order)]))
        elif event.key() in ENTER_KEYS:
            if self._at >= 0:
                self.taken.emit(self._at)
        elif event.key() == Qt.Key.Key_Escape:
            self.escaped.emit()
        else:
            super().keyPressEvent(event)

    def _nearest(self, here: QPointF) -> int:
        """The index of the point nearest to a place on the axes; -1: none is within NEAR_PIXELS.

        A learned one goes before one of the string, unless that is CLOSER_PIXELS nearer.
        """
        if not len(self._places) or math.isnan(here.x()):
            return -1
        wide, high = self.getPlotItem().vb.viewPixelSize()
        off = np.hypot((self._places[:, 0] - here.x()) / wide, (self._places[:, 1] - here.y()) / high)
        point = int((off + CLOSER_PIXELS * (np.arange(len(off)) >= self._learned_count)).argmin())
        return point if off[point] <= NEAR_PIXELS else -1

    def _point_at(self, point: int) -> None:
        """Put the ring around a point, and report it; -1: around none."""
        if point != self._at:
            self._at = point
            at = self._places[point : point + 1] if point >= 0 else np.empty((0, 2))
            self._ring.setData(x=at[:, 0], y=at[:, 1])
            self.pointed.emit(point)
