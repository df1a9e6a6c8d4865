"""The error map: a model's error over position and amplitude of the pluck.

The mouse or the arrow keys move a cursor; a click or Enter plucks there.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent, QResizeEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app.analysis.error_plane import AMPLITUDES_MM, POSITIONS, PlanePicture, nearest_cell, refine
from app.views import theme
from app.views.controls.parts import ENTER_KEYS, keeps_own_keys, words_label
from app.views.controls.progress_strip import ProgressStrip
from app.views.plots.axis_label import UprightLabel, UprightTicks, fit_foot
from app.views.plots.colour_maps import share_map

SCALE = (8e-4, 1.25)  # relative errors at the ends of the colours
TIP_MS = 3000  # the tooltip covers what is pointed at
SMOOTHER = 4  # pixels of the picture to a step of the finest grid
_LABELLED_MM = (0.5, 1, 2, 5, 10, 20)
_LABELLED_ERRORS = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
_STEP_X = POSITIONS[1] - POSITIONS[0]
_STEP_Y = math.log10(AMPLITUDES_MM[1] / AMPLITUDES_MM[0])

OUTLINE = 25  # places at which the trained amplitudes are drawn

Range = tuple[float, float]


class ErrorPlaneView(QWidget):
    """The map with a line of words above it. Positions are shares of the string's length, amplitudes in mm."""

    pluck_chosen = Signal(float, float)  # position, amplitude in mm

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName("Error map")
        self.setMinimumHeight(84)
        self._words = words_label()
        self._words.setContentsMargins(4, 0, 4, 0)
        self.progress = ProgressStrip("Progress of the error map")
        self.map = _Map()
        self.map.pointed.connect(self._tell)
        self.map.taken.connect(self.pluck_chosen)
        self._picture: PlanePicture | None = None
        self._resting = ""
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 4, 0, 0)
        column.setSpacing(4)
        column.addWidget(self._words)
        column.addWidget(self.progress)
        column.addWidget(self.map, 1)

    @property
    def words(self) -> str:
        return self._words.text()

    def show_picture(self, picture: PlanePicture | None) -> None:
        """The errors computed so far; None: none."""
        self._picture = picture
        self.map.show_picture(picture)
        self._tell(*(self.map.cursor or (math.nan, math.nan)))

    def set_pluck(self, position: float, amplitude_mm: float) -> None:
        """The present pluck."""
        self.map.set_pluck(position, amplitude_mm)

    def set_trained(self, position: Range | None, amplitudes_mm: Callable[[float], Range]) -> None:
        """The training range: positions, None for a model trained on noise, and the amplitudes at each of them."""
        self.map.set_trained(position, amplitudes_mm)

    def set_words(self, text: str) -> None:
        """The line above the map while nothing is pointed at."""
        self._resting = text
        self._tell(*(self.map.cursor or (math.nan, math.nan)))

    def _tell(self, position: float, amplitude_mm: float) -> None:
        if self._picture is None or math.isnan(position):
            self._words.setText(self._resting)
            return
        error = self._picture.at(position, amplitude_mm)
        text = "runs away" if math.isinf(error) else f"error as trained about {100 * error:.2g} %"
        if self._picture.spacing > 1:
            text += ", still coarse"
        trained = "" if self.map.is_trained(position, amplitude_mm) else ",  outside the training range"
        self._words.setText(f"Pluck at {position:.2f},  {amplitude_mm:.2g} mm:  {text}{trained}")


class _Map(pg.PlotWidget):
    """The picture with its colour bar, the trained range, the present pluck and a cursor."""

    pointed = Signal(float, float)  # position, amplitude in mm; NaN: nowhere
    taken = Signal(float, float)

    def __init__(self) -> None:
        super().__init__()
        self.setAccessibleName("Map of errors")
        self.setToolTip(
            "The model's error as trained (the first figure in the header) for each pluck position and amplitude.\n"
            "Click, or arrow keys and Enter: pluck there. Ring: the present pluck; dashed: the training range"
        )
        self.setToolTipDuration(TIP_MS)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        self.setCursor(Qt.CursorShape.CrossCursor)
        item = self.getPlotItem()
        item.setContentsMargins(0, 6, 0, 0)  # room for half of the topmost number
        item.setMenuEnabled(False)
        item.hideButtons()
        item.setMouseEnabled(False, False)
        item.setLabel("bottom", "pluck position")
        item.getAxis("bottom").enableAutoSIPrefix(False)
        self._label = UprightLabel(item, ("amplitude (mm)", "mm"))
        self._area = QRectF(
            POSITIONS[0] - _STEP_X / 2,
            math.log10(AMPLITUDES_MM[0]) - _STEP_Y / 2,
            POSITIONS[-1] - POSITIONS[0] + _STEP_X,
            math.log10(AMPLITUDES_MM[-1] / AMPLITUDES_MM[0]) + _STEP_Y,
        )
        item.setRange(self._area, padding=0)
        self._ticks = UprightTicks(item.getAxis("left"), item.vb)
        self._ticks.set((math.log10(mm), f"{mm:g}") for mm in _LABELLED_MM)
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
        self._trained: tuple[Range, Callable[[float], Range]] | None = None
        self._present = (0.35, 4.0)
        self.cursor: tuple[float, float] | None = None

    def _take_theme(self) -> None:
        self._bar.setColorMap(share_map())

    def show_picture(self, picture: PlanePicture | None) -> None:
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
        return _within(position, places) and _within(amplitude_mm, amplitudes_mm(position))

    def resizeEvent(self, event: QResizeEvent | None) -> None:
        super().resizeEvent(event)
        if self.getPlotItem() is not None:  # it is, while this is being made
            fit_foot(self)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        at = self._at(event.position())
        if event.button() == Qt.MouseButton.LeftButton and at is not None:
            self._point_at(at)
            self.taken.emit(*at)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        self._point_at(self._at(event.position()))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        event.accept()

    def leaveEvent(self, event: QEvent) -> None:
        self._point_at(None)
        super().leaveEvent(event)

    def event(self, event: QEvent) -> bool:
        """Keeps Enter and Esc, which are shortcuts of the window, while the map has the focus."""
        return keeps_own_keys(event) or bool(super().event(event))

    def keyPressEvent(self, event: QKeyEvent) -> None:
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

    def _at(self, place: QPointF) -> tuple[float, float] | None:
        """The pluck that a place of the widget stands for, None beside the map."""
        at = self.getPlotItem().vb.mapSceneToView(self.mapToScene(place.toPoint()))
        if not self._area.contains(at):
            return None
        position = min(max(at.x(), float(POSITIONS[0])), float(POSITIONS[-1]))
        amplitude_mm = min(max(10 ** at.y(), float(AMPLITUDES_MM[0])), float(AMPLITUDES_MM[-1]))
        return position, amplitude_mm

    def _point_at(self, at: tuple[float, float] | None) -> None:
        self.cursor = at
        if at is None:
            self._cursor.setData([], [])
            self.pointed.emit(math.nan, math.nan)
        else:
            self._cursor.setData([at[0]], [math.log10(at[1])])
            self.pointed.emit(*at)


def _within(value: float, bounds: Range) -> bool:
    return bounds[0] - 1e-9 <= value <= bounds[1] + 1e-9
