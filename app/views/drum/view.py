"""A drum seen from above: the slots' content in motion, in colours, and the places of strike and listening.

A click on the drum strikes it there with the velocity of the keys, with Shift as hard as it goes. Arrow keys move the
place, Enter strikes there.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from PySide6.QtCore import QLineF, QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QMouseEvent, QPainter
from PySide6.QtWidgets import QWidget

from app.views.drum.axes import HeadAxes, Place, Shape
from app.views.drum.ink import (
    HeadFrame,
    angle_words,
    kept_scale_m,
    paint_edge,
    paint_motion,
    paint_name,
    paint_place,
    paint_rest,
    paint_scale,
    place_words,
)
from app.views.painting import set_ink
from app.views.stage import MARGIN_X, StageView, paint_caption

STEP, FINE_STEP = 0.05, 0.01  # of the arrow keys, in half-lengths
STRIKE_TIP = (
    "Click to strike the drum with the velocity of the keys; with Shift as hard as it goes.\n"
    "Arrow keys move the place, Enter strikes there"
)

_Shift = Qt.KeyboardModifier.ShiftModifier
_Control = Qt.KeyboardModifier.ControlModifier


class DrumView(StageView):
    """A picture of the drum for each source that the slots A and B hold, side by side.

    Places are given from the centre in half-lengths. The only part is "drum", where it can be struck.
    """

    struck = Signal(float, float, bool)  # place, and whether as hard as it goes
    place_moved = Signal(float, float)  # by an arrow key, to this place
    place_reset = Signal()  # by Delete

    NAME: ClassVar = "Drum"
    ELSEWHERE: ClassVar = "another side"
    MARK_NAMES: ClassVar = {"left": "L:", "right": "R:"}
    CURSORS: ClassVar = {None: Qt.CursorShape.ArrowCursor, "drum": Qt.CursorShape.CrossCursor}
    TIPS: ClassVar = {None: STRIKE_TIP, "drum": STRIKE_TIP}

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._name = ""  # of the drum, in words
        self._shape: Shape = "circle"
        self._sides = (1.0, 1.0)  # length and width in m
        self._place: Place = (0.0, 0.0)  # of the strike
        self._frame: HeadFrame | None = None  # the moment that is drawn; None: at rest
        self._scales_m: dict[str, float] = {}  # source -> displacement of the full colour; kept from frame to frame

    # What is shown

    def set_drum(self, name: str, shape: Shape, sides: tuple[float, float]) -> None:
        """Set the drum that a click strikes; `sides`: its length and width in m."""
        if (name, shape, sides) != (self._name, self._shape, self._sides):
            self._name = name
            self._shape = shape
            self._sides = sides
            self._frame = None
            self._describe()
            self.update()

    def set_place(self, place: Place) -> None:
        """Set the place where Enter strikes, and where it was struck last."""
        self._place = place
        self._describe()
        self.update()

    def _describe(self) -> None:
        """Describe to screen readers the drum, the place of the strike, and the angles of listening."""
        angles = " and ".join(angle_words(point) for point in self._listening.values())
        where = f", heard from {angles}" if angles else ""
        self.setAccessibleDescription(f"{self._name}, struck at {place_words(self._place)}{where}")

    def set_listening_points(self, left: float | None, right: float | None = None) -> None:
        super().set_listening_points(left, right)
        self._describe()

    def show_frame(self, frame: HeadFrame | None) -> None:
        """Show a moment of the motion; None: at rest."""
        before, self._frame = self._frame, frame
        if frame is None:
            self._scales_m = {}
        else:
            for source, picture in frame.pictures_m.items():
                largest_m = float(np.abs(picture).max())
                self._scales_m[source] = kept_scale_m(largest_m, self._scales_m.get(source, 0.0))
        if frame is not before:
            self.update()

    @property
    def frame(self) -> HeadFrame | None:
        """The frame that is drawn; None: the drum at rest."""
        return self._frame

    @property
    def axes(self) -> HeadAxes:
        return HeadAxes(self.width(), self.height(), self._shape, self._sides, max(1, len(self._sources)))

    # Gestures

    def _press(self, part: str | None, event: QMouseEvent) -> None:
        """Strike the drum; fast repeats are blows too."""
        if (place := self.axes.place(event.position())) is not None:
            self.struck.emit(*place, bool(event.modifiers() & _Shift))

    def _take_key(self, key: Qt.Key, across: int, up: int, modifiers: Qt.KeyboardModifier) -> bool:
        """Move the place of the strike by an arrow, with Shift finely; reset it by Delete."""
        if (across or up) and not modifiers & _Control:
            step = FINE_STEP if modifiers & _Shift else STEP
            place = self._place[0] + step * across, self._place[1] + step * up
            if self.axes.holds(place):
                self.place_moved.emit(*place)
        elif key == Qt.Key.Key_Delete:
            self.place_reset.emit()
        else:
            return False
        return True

    def _picture_part_at(self, at: QPointF) -> str | None:
        return "drum" if self.axes.place(at) is not None else None

    # Painting

    def _paint_picture(self, painter: QPainter) -> None:
        """Paint a drum for each source: its motion with the scale, or the drum at rest, its edge, and the strike."""
        axes = self.axes
        pictures_m = {} if self._frame is None else self._frame.pictures_m
        for head, source in enumerate(self._sources):
            if source.source in pictures_m:
                scale_m = self._scales_m[source.source]
                paint_motion(painter, axes, head, pictures_m[source.source], scale_m)
                if not self._plain:
                    paint_scale(painter, axes, head, scale_m)
            else:
                paint_rest(painter, axes, head)
            paint_edge(painter, axes, head, source.source)
            paint_place(painter, axes.at(head, self._place), self.hasFocus())

    def _paint_listening_line(self, painter: QPainter, x: float, colour: QColor) -> None:
        bottom = self.axes.bottom
        set_ink(painter, colour)
        painter.drawLine(QLineF(x, bottom - 8, x, bottom + 2))

    def _point_words(self, point: float) -> str:
        return angle_words(point)

    def _paint_over(self, painter: QPainter) -> None:
        axes = self.axes
        paint_name(painter, axes, self._name, self._listening.values())
        if self._frame is not None and not self._plain:
            place = QRectF(MARGIN_X, axes.height - 22, axes.width - 2 * MARGIN_X, 18)
            paint_caption(painter, place, self._frame.caption)
