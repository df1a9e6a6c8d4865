"""A drum seen from above: the slots' content in motion, in colours, and the places of strike and listening.

A click on the drum strikes it there with the velocity of the keys, with Shift as hard as it goes. Dragging a mark
beneath it moves a listening point. Arrow keys move the place, Enter strikes there.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from PySide6.QtCore import QPointF, Qt, Signal
from PySide6.QtGui import QMouseEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget

from app.views.drum.axes import HeadAxes, Place, Shape
from app.views.drum.ink import (
    HeadFrame,
    angle_words,
    kept_scale_m,
    paint_caption,
    paint_edge,
    paint_listening,
    paint_motion,
    paint_name,
    paint_place,
    paint_rest,
    paint_scale,
    place_words,
)
from app.views.stage import StageView

STEP, FINE_STEP = 0.05, 0.01  # of the arrow keys, in half-lengths
MARK_TIP = "Drag to hear the drum from another side; double-click resets. Shift and arrow keys move it"
STRIKE_TIP = (
    "Click to strike the drum with the velocity of the keys; with Shift as hard as it goes.\n"
    "Arrow keys move the place, Enter strikes there"
)
TIPS = {"left": MARK_TIP, "right": MARK_TIP.replace("Shift", "Ctrl, Shift")}

_Shift = Qt.KeyboardModifier.ShiftModifier
_Control = Qt.KeyboardModifier.ControlModifier


class DrumView(StageView):
    """Places are given from the centre in half-lengths; a `side` of the listener is "left" or "right"."""

    struck = Signal(float, float, bool)  # place, and whether as hard as it goes
    place_moved = Signal(float, float)
    place_reset = Signal()

    CURSORS: ClassVar = {None: Qt.CursorShape.ArrowCursor, "drum": Qt.CursorShape.CrossCursor}

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Drum", STRIKE_TIP, parent)
        self._name = ""
        self._shape: Shape = "circle"
        self._sides = (1.0, 1.0)
        self._place: Place = (0.0, 0.0)
        self._frame: HeadFrame | None = None
        self._scales_m: dict[str, float] = {}
        self._add_toggle("Motion", "Show the drum in motion; off saves processor time (M)", self.motion_toggled)

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
        angles = " and ".join(angle_words(point) for point in self._listening.values())
        where = f", heard from {angles}" if angles else ""
        self.setAccessibleDescription(f"{self._name}, struck at {place_words(self._place)}{where}")

    def set_listening_points(self, left: float | None, right: float | None = None) -> None:
        super().set_listening_points(left, right)
        self._describe()

    def set_motion(self, shown: bool) -> None:
        """Set the state of the button; the frames given to `show_frame` should agree with it."""
        self._toggles[0].setChecked(shown)

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
        """Places on the picture, in pixels."""
        return HeadAxes(self.width(), self.height(), self._shape, self._sides, max(1, len(self._sources)))

    # Gestures

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() != Qt.MouseButton.LeftButton:
            return
        axes, at = self.axes, event.position()
        if (side := self._mark_under(at)) is not None:
            self.drag_started.emit()
            self._drag = side
            self.update()
        elif (place := axes.place(at)) is not None:
            self.struck.emit(*place, bool(event.modifiers() & _Shift))

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        side = self._mark_under(event.position())
        if event.button() == Qt.MouseButton.LeftButton and side is not None:
            self.listening_point_reset.emit(side)
        else:
            self.mousePressEvent(event)  # fast repeats are blows too

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._drag is None:
            part = self._part_at(event.position())
            self._hover(part)
            self.setToolTip(TIPS.get(part or "", STRIKE_TIP))
            return
        point = self.axes.point(0, event.position().x())
        self.listening_point_moved.emit(self._drag, min(max(point, 0.0), 1.0))

    def _take_key(self, key: Qt.Key, across: int, up: int, modifiers: Qt.KeyboardModifier) -> bool:
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

    def _part_at(self, at: QPointF) -> str | None:
        return self._mark_under(at) or ("drum" if self.axes.place(at) is not None else None)

    def _mark_x(self, point: float) -> float:
        return self.axes.x(0, point)

    # Painting

    def paintEvent(self, event: QPaintEvent) -> None:
        axes, frame = self.axes, self._frame
        painter = QPainter(self)
        painter.drawPixmap(0, 0, self._ground_of())
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        pictures: Mapping[str, object] = {} if frame is None else frame.pictures_m
        for head, source in enumerate(self._sources):
            if frame is not None and source.source in pictures:
                scale_m = self._scales_m[source.source]
                paint_motion(painter, axes, head, frame.pictures_m[source.source], scale_m)
                if not self._plain:
                    paint_scale(painter, axes, head, scale_m)
            else:
                paint_rest(painter, axes, head)
            paint_edge(painter, axes, head, source)
            paint_place(painter, axes.at(head, self._place), self.hasFocus())
        grabbed = self._drag or self._hovered
        if self._listening:
            paint_listening(painter, axes, self._listening, grabbed)
        paint_name(painter, axes, self._name, self._listening)
        if frame is not None and not self._plain:
            paint_caption(painter, axes, frame.caption)
