"""The error map: the error of the chosen preset over position and amplitude, for plucks of the chosen shape.

The mouse or the arrow keys move a cursor; a click or Enter plucks there.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent

from app.analysis.error_plane import AMPLITUDES_MM, POSITIONS, ErrorPlane, PlanePicture, nearest_cell, refine
from app.export.columns import Columns
from app.presets.library import Library
from app.presets.words import percent
from app.rendering.subject import Subject, load_subject, string_of
from app.session.slots import info_of, subject_of
from app.shared.worker import Job
from app.stage.session import Session
from app.views import theme
from app.views.controls.parts import ENTER_KEYS, lay_out_view
from app.views.plots.axis_label import UprightTicks
from app.views.plots.colour_maps import share_map
from app.views.plots.plot import Plot
from app.window.panels.base import ComputedPanel, Moment
from engine.pluck import Pluck
from engine.presets import preset_digest

FORM_FIELDS = frozenset({"preset", "string", "shape", "width"})  # where one of these changes, so does the map
MOST_KEPT = 64  # planes of some 13 KB
SCALE = (8e-4, 1.25)  # relative errors at the ends of the colours
SMOOTHER = 4  # pixels of the picture to a step of the finest grid
_LABELLED_MM = (0.5, 1, 2, 5, 10, 20)
_LABELLED_ERRORS = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
_STEP_X = POSITIONS[1] - POSITIONS[0]
_STEP_Y = math.log10(AMPLITUDES_MM[1] / AMPLITUDES_MM[0])
OUTLINE = 25  # places at which the trained amplitudes are drawn

Range = tuple[float, float]


class ErrorPlanePanel(ComputedPanel):
    """The map of errors. Positions are shares of the string's length, amplitudes in mm."""

    SETTLED_S = 0.3  # a width that is still being turned is not computed
    key = "error_plane"
    title = "Error map"
    help = (
        "The model's error as trained, the first figure in the header, over pluck position and amplitude, computed "
        "in the background. A click plucks there."
    )

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library, "The error map of this preset could not be computed")
        self.map = self.figure = _Map()
        self.map.pointed.connect(self._show_values)
        self.map.taken.connect(self._audition)
        self._picture: PlanePicture | None = None  # errors so far; None: none
        self._moved = False  # the pluck has moved since its ring was drawn
        self._planes = _Planes()
        self.background.progressed.connect(self._show_progress)
        self.background.finished.connect(self._show_finished)
        lay_out_view(self, (), self._words, (), self.progress, self.map, top=4)

    def choices_changed(self, names: frozenset[str]) -> None:
        entry = self.library.find(self.session.choices.preset)
        self._moved |= bool(names & {"position", "amplitude_mm"})
        if names & FORM_FIELDS and entry is not None:
            info, pluck = info_of(self.session.choices, entry), self.session.choices.pluck
            self.map.set_trained(
                info.trained_range.position, lambda place: info.trained_amplitudes_mm(pluck.moved(position=place))
            )
        super().choices_changed(names)

    def _draw_moment(self, moment: Moment) -> None:
        super()._draw_moment(moment)
        if self._moved:
            pluck = self.session.choices.pluck
            self.map.set_pluck(pluck.position, pluck.amplitude_mm)
            self._moved = False

    def _wanted(self) -> object:
        choices = self.session.choices
        entry = self.library.find(choices.preset)
        return None if entry is None else (subject_of(choices, entry.path), *_pluck_form(choices.pluck))

    def _clear(self) -> None:
        self._show(None)
        self._say("")

    def _begin(self) -> None:
        choices = self.session.choices
        entry = self.library.find(choices.preset)
        if entry is not None:
            subject, pluck = subject_of(choices, entry.path), choices.pluck
            self._say("Computing the model's error for plucks of this shape …", 0.0)
            self.compute(lambda job: self._planes.compute(subject, pluck, job), [entry.info])

    def _show_progress(self, share: float, _: str, picture: PlanePicture | None) -> None:
        self.progress.show_share(share)
        if picture is not None:
            self._show(picture)

    def _show_finished(self, picture: PlanePicture) -> None:
        self._show(picture)
        self._say("Error as trained, for plucks of this shape; a click plucks there")

    def _audition(self, position: float, amplitude_mm: float) -> None:
        self.session.move_pluck(round(position, 3), round(amplitude_mm, 2))
        self.pluck_asked.emit()

    def _show(self, picture: PlanePicture | None) -> None:
        """Show the errors computed so far; None: none."""
        self._picture = picture
        self.map.show_picture(picture)
        self._show_values(*(self.map.cursor or (math.nan, math.nan)))

    def columns(self) -> Columns | None:
        if self._picture is None:
            return None
        positions, amplitudes_mm = map(np.ravel, np.meshgrid(POSITIONS, AMPLITUDES_MM, indexing="ij"))
        error = self._picture.error.ravel()
        return Columns({"position": positions, "amplitude (mm)": amplitudes_mm, "MAE (of the truth)": error})

    def _show_values(self, position: float, amplitude_mm: float) -> None:
        """Write the error at a pluck above the map; a position of NaN: nothing is pointed at."""
        if self._picture is None or math.isnan(position):
            self._words.report("")
            return
        error = self._picture.at(position, amplitude_mm)
        text = "diverges" if math.isinf(error) else f"error as trained about {percent(error)}"
        if self._picture.spacing > 1:
            text += ", still coarse"
        trained = "" if self.map.is_trained(position, amplitude_mm) else ",  outside the training range"
        self._words.report(f"Pluck at {position:.2f},  {amplitude_mm:.2g} mm:  {text}{trained}")


class _Planes:
    """The planes so far, by the preset's content, the string and the form of the pluck. Used by one thread."""

    def __init__(self) -> None:
        self._known: dict[tuple[object, ...], ErrorPlane] = {}

    def compute(self, subject: Subject, pluck: Pluck, job: Job) -> PlanePicture:
        """Compute what the plane of a preset and a form of pluck still lacks; return all of its errors.

        The latest MOST_KEPT planes are kept.
        """
        preset = load_subject(subject)
        key = (preset_digest(preset.path), string_of(subject), *_pluck_form(pluck))
        plane = self._known.pop(key, None) or ErrorPlane()
        self._known[key] = plane  # the latest last
        for oldest in list(self._known)[:-MOST_KEPT]:
            del self._known[oldest]
        return plane.compute(preset, pluck, job)


def _pluck_form(pluck: Pluck) -> tuple[object, ...]:
    """The form of a pluck, which a plane belongs to: its shape and its width; None: a triangle has no width."""
    return (pluck.shape, None if pluck.shape == "triangular" else pluck.width)


class _Map(Plot):
    """The picture with its colour bar, the trained range, the present pluck and a cursor.

    The axes are the pluck's position (0 … 1) and log₁₀ of its amplitude in mm; colours are log₁₀ of the error.
    """

    pointed = Signal(float, float)  # position, amplitude in mm; NaN: nowhere
    taken = Signal(float, float)  # the same, to be plucked
    KEPT_KEYS = (*ENTER_KEYS, Qt.Key.Key_Escape)

    def __init__(self) -> None:
        super().__init__(
            "Map of errors",
            "The model's error as trained (the first figure in the header) for each pluck position and amplitude.\n"
            "Click, or arrow keys and Enter: pluck there. Ring: the present pluck; dashed: the training range",
            "pluck position",
        )
        self.hovered.connect(lambda x, y: self._point_at(self._pluck_at(QPointF(x, y))))
        self.setCursor(Qt.CursorShape.CrossCursor)
        item = self.getPlotItem()
        item.setContentsMargins(0, 6, 0, 0)  # room for half of the topmost number
        item.setMouseEnabled(False, False)
        self.label.set("amplitude (mm)", "mm")
        self._area = QRectF(
            POSITIONS[0] - _STEP_X / 2,
            math.log10(AMPLITUDES_MM[0]) - _STEP_Y / 2,
            POSITIONS[-1] - POSITIONS[0] + _STEP_X,
            math.log10(AMPLITUDES_MM[-1] / AMPLITUDES_MM[0]) + _STEP_Y,
        )
        item.setRange(self._area, padding=0)
        self.ticks.set((math.log10(mm), f"{mm:g}") for mm in _LABELLED_MM)
        self._image = pg.ImageItem()
        self._image.setLevels([math.log10(end) for end in SCALE])
        item.addItem(self._image)
        self._bar = pg.ColorBarItem(
            values=tuple(math.log10(end) for end in SCALE), colorMap=share_map(), interactive=False, width=14
        )
        self._bar_ticks = UprightTicks(self._bar.axis, self._bar.vb)
        self._bar_ticks.set((math.log10(e), f"{100 * e:g} %") for e in _LABELLED_ERRORS)
        self._bar.setImageItem(self._image, insert_in=item)
        theme.changes.theme_changed.connect(self._take_theme)
        dashed = pg.mkPen(theme.TEXT, width=1, style=Qt.PenStyle.DashLine)
        self._outline = item.plot(pen=dashed)
        self._pluck = pg.ScatterPlotItem(symbol="o", size=13, pen=pg.mkPen(theme.TEXT, width=2), brush=None)
        self._cursor = pg.ScatterPlotItem(symbol="+", size=15, pen=pg.mkPen(theme.TEXT, width=1), brush=None)
        for thing in (self._pluck, self._cursor):
            item.addItem(thing)
        # positions of the training, and the amplitudes in mm by position; None: not known yet
        self._trained: tuple[Range, Callable[[float], Range]] | None = None
        self._present = (0.35, 4.0)  # the pluck that is chosen: position, amplitude in mm
        self.cursor: tuple[float, float] | None = None  # position, amplitude in mm; None: nowhere

    def _take_theme(self) -> None:
        self._bar.setColorMap(share_map())

    def show_picture(self, picture: PlanePicture | None) -> None:
        """Draw the errors, log₁₀ as colours; None: draw none."""
        if picture is None:
            self._image.clear()
            return
        errors_log = np.log10(np.clip(picture.error, SCALE[0] / 10, 10 * SCALE[1]))
        # the levels are those of the colour bar and must not follow the picture
        self._image.setImage(refine(errors_log, SMOOTHER), autoLevels=False)
        self._image.setRect(self._area)

    def set_pluck(self, position: float, amplitude_mm: float) -> None:
        self._present = (position, amplitude_mm)
        held_mm = min(max(amplitude_mm, AMPLITUDES_MM[0]), AMPLITUDES_MM[-1])
        self._pluck.setData([position], [math.log10(held_mm)])

    def set_trained(self, position: Range | None, amplitudes_mm: Callable[[float], Range]) -> None:
        """Set the training range, whose outline is drawn.

        Args:
            position: lowest and highest; None: a model trained on noise has none, so all are within.
            amplitudes_mm: the least and the largest amplitude at a position.
        """
        left, right = position or (float(POSITIONS[0]), float(POSITIONS[-1]))
        self._trained = ((left, right), amplitudes_mm)
        places = np.linspace(left, right, OUTLINE)
        low, high = np.log10(
            np.clip([amplitudes_mm(float(place)) for place in places], AMPLITUDES_MM[0] / 10, 10 * AMPLITUDES_MM[-1])
        ).T
        self._outline.setData([*places, *places[::-1], left], [*low, *high[::-1], low[0]])

    def is_trained(self, position: float, amplitude_mm: float) -> bool:
        if self._trained is None:
            return True
        places, amplitudes_mm = self._trained
        return _is_within(position, places) and _is_within(amplitude_mm, amplitudes_mm(position))

    def mousePressEvent(self, event: QMouseEvent) -> None:
        at = self._pluck_at(self.place_at(event.position()))
        if event.button() == Qt.MouseButton.LeftButton and at is not None:
            self._point_at(at)
            self.taken.emit(*at)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        event.accept()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Move the cursor by a point of the grid with an arrow key; Enter plucks there, Escape hides the cursor."""
        step = {
            Qt.Key.Key_Left: (-1, 0),
            Qt.Key.Key_Right: (1, 0),
            Qt.Key.Key_Down: (0, -1),
            Qt.Key.Key_Up: (0, 1),
        }.get(Qt.Key(event.key()))
        if step is not None:
            x, y = nearest_cell(*(self.cursor or self._present))
            x = min(max(x + step[0], 0), len(POSITIONS) - 1)
            y = min(max(y + step[1], 0), len(AMPLITUDES_MM) - 1)
            self._point_at((float(POSITIONS[x]), float(AMPLITUDES_MM[y])))
        elif event.key() in ENTER_KEYS:
            if self.cursor is not None:
                self.taken.emit(*self.cursor)
        elif event.key() == Qt.Key.Key_Escape:
            self._point_at(None)
        else:
            super().keyPressEvent(event)

    def _pluck_at(self, at: QPointF) -> tuple[float, float] | None:
        """The position and the amplitude in mm at a place on the axes; None: it is outside the map."""
        if math.isnan(at.x()) or not self._area.contains(at):  # which holds NaN, in Qt's arithmetic
            return None
        position = min(max(at.x(), float(POSITIONS[0])), float(POSITIONS[-1]))
        amplitude_mm = min(max(10 ** at.y(), float(AMPLITUDES_MM[0])), float(AMPLITUDES_MM[-1]))
        return position, amplitude_mm

    def _point_at(self, at: tuple[float, float] | None) -> None:
        """Move the cursor to a position and an amplitude in mm; None: hide it."""
        self.cursor = at
        if at is None:
            self._cursor.setData([], [])
            self.pointed.emit(math.nan, math.nan)
        else:
            self._cursor.setData([at[0]], [math.log10(at[1])])
            self.pointed.emit(*at)


def _is_within(value: float, bounds: Range) -> bool:
    return bounds[0] - 1e-9 <= value <= bounds[1] + 1e-9
