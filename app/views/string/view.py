"""The string: what the slots hold in motion, the pluck that is being drawn, and the listening points.

A click on the string plucks it there with the last amplitude, a drag there with the amplitude of its end. The wheel
over the handle sets the width, with Shift the shape. A double-click on the handle resets the pluck.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent, QPixmap, QWheelEvent
from PySide6.QtWidgets import QApplication, QWidget

from app.analysis.moment import StringFrame
from app.views.stage import FINE, GRAB_PIXELS, WORDS_HEIGHT, StageView, paint_caption
from app.views.string.axes import StringAxes
from app.views.string.ground import TrainedPlucks, paint_ground
from app.views.string.ink import (
    ShownPluck,
    paint_ends,
    paint_envelopes,
    paint_handle,
    paint_listening_line,
    paint_motion,
    paint_pluck,
)

SPANS_MM = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)  # the display's half height, chosen to fit
LEAST_DRAGGED_MM = 0.5  # so that a drag that ends on the string's line is heard

_Shift = Qt.KeyboardModifier.ShiftModifier
_Control = Qt.KeyboardModifier.ControlModifier


class StringView(StageView):
    """Positions are shares of the string's length, displacements in mm. The only part is "pluck", its handle."""

    pluck_drawn = Signal(float, float)  # position, amplitude: while dragging
    pluck_released = Signal()
    pluck_reset = Signal()
    width_stepped = Signal(float)  # notches of the wheel
    shape_stepped = Signal(int)  # so many shapes on or back
    envelope_toggled = Signal(bool)

    NAME: ClassVar = "String"
    ELSEWHERE: ClassVar = "another point"
    MARK_NAMES: ClassVar = {"left": "left", "right": "right"}
    CURSORS: ClassVar = {None: Qt.CursorShape.CrossCursor, "pluck": Qt.CursorShape.OpenHandCursor}
    TIPS: ClassVar = {
        None: "Click or drag to pluck the string; with Shift the drag is finer. Enter plucks again, "
        "F1 shows all keys",
        "pluck": "Drag along the string for the position, up and down for the amplitude; double-click resets.\n"
        "The wheel sets the width, with Shift the shape. Arrow keys do the same, with Ctrl for width and shape",
    }

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._frame: StringFrame | None = None  # the moment of the motion; None: the pluck is drawn
        self._pluck = ShownPluck(0.35, 4.0, np.zeros(2))
        self._trained = TrainedPlucks()  # beyond this the picture is hatched
        self._span_mm = 5.0  # half the height of the picture, one of SPANS_MM
        self._dragged = (0.0, 0.0)  # position and displacement in mm that the drag has come to, unlimited
        self._pressed_at = QPointF()  # of the mouse, where the drag began
        self._on_bare_string = False  # the press was not on the handle
        self._far = False  # the drag has gone too far from the press to be a click
        self._amplitude_mm = 0.0  # of the pluck as the drag began
        self._on_handle_first = False  # the last press was the first of a series, and on the handle
        self._last_press_ms = -10_000  # on Qt's clock of events; long ago
        self._turned = 0.0  # notches of the wheel towards the next shape
        self._swung: tuple[object, object, QPixmap] | None = None  # ground, envelopes, and both in one picture
        self._add_toggle(
            "Envelope", "Show how far the string swung within the last second (N)", self.envelope_toggled
        )

    # What is shown

    def set_pluck(self, pluck: ShownPluck) -> None:
        """Set the pluck as chosen; it is drawn while no motion is shown."""
        self._pluck = pluck
        self.setAccessibleDescription(f"position {pluck.position:.2f}, {pluck.amplitude_mm:.2f} mm, {pluck.label}")
        self.update()

    def set_trained(self, trained: TrainedPlucks) -> None:
        """Set the training range, outside of which the picture is hatched."""
        self._trained = trained
        self.update()

    def show_frame(self, frame: StringFrame | None) -> None:
        """Show a moment of the motion; None goes back to the pluck."""
        before = self._frame
        self._frame = frame
        span_mm = self._span_mm
        self._fit_span()
        if frame is None or before is None or self._span_mm != span_mm:
            if frame is not before:
                self.update()
        else:  # all that moves lies in one rectangle, between the legend above and the markers below
            self.update(0, WORDS_HEIGHT, self.width(), math.ceil(self.axes.bottom) - WORDS_HEIGHT)

    @property
    def shapes_mm(self) -> Mapping[str, NDArray[np.floating]]:
        """The displacements that are drawn, by source; the pluck, under "", while it is."""
        return {"": self._pluck.shape_mm} if self._shown_motion is None else self._shown_motion.shapes

    @property
    def _shown_motion(self) -> StringFrame | None:
        """The moment that is drawn; None: the pluck is."""
        return None if self._drag == "pluck" else self._frame

    # Gestures

    def _press(self, part: str | None, event: QMouseEvent) -> None:
        follows = event.timestamp() - self._last_press_ms < QApplication.doubleClickInterval()
        self._on_handle_first = part == "pluck" and not follows
        self._begin_pluck(part, event)

    def _press_again(self, part: str | None, event: QMouseEvent) -> None:
        if self._on_handle_first:
            self.pluck_reset.emit()
        else:  # the same place is plucked again and again
            self._begin_pluck(part, event)

    def _begin_pluck(self, part: str | None, event: QMouseEvent) -> None:
        """Begin to drag the handle, or a pluck on the bare string (None)."""
        self._last_press_ms = event.timestamp()
        # at the scale of the pluck, not of the decayed motion
        self._span_mm = max(self._span_mm, _span_mm(self._pluck.amplitude_mm))
        axes, at = self.axes, event.position()
        self._start_drag("pluck", at)
        self._pressed_at = at
        self._far = False
        self._on_bare_string = part is None
        self._amplitude_mm = self._pluck.amplitude_mm
        if part == "pluck":
            self._dragged = (self._pluck.position, self._pluck.amplitude_mm)
            self.setCursor(Qt.CursorShape.ClosedHandCursor)
        else:
            self._dragged = (axes.position(at.x()), axes.displacement_mm(at.y()))
            self.pluck_drawn.emit(self._dragged[0], self._amplitude_mm)  # a click does no more

    def _drag_on(self, at: QPointF, by: QPointF) -> None:
        """Draw the pluck where the drag has come to; on the bare string only once it is too far for a click."""
        axes = self.axes
        position = self._dragged[0] + by.x() / axes.length
        displacement_mm = self._dragged[1] - by.y() / axes.half_height * axes.span_mm
        self._dragged = (position, displacement_mm)
        self._far |= (at - self._pressed_at).manhattanLength() >= QApplication.startDragDistance()
        if self._far or not self._on_bare_string:
            least_mm = LEAST_DRAGGED_MM if self._far else min(LEAST_DRAGGED_MM, self._amplitude_mm)
            self.pluck_drawn.emit(position, max(abs(displacement_mm), least_mm))
            self._fit_span()

    def _drop(self, part: str) -> None:
        if part == "pluck":
            self.pluck_released.emit()

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Set the pluck's width by the wheel over its handle, or with Shift its shape, in whole notches."""
        if self._part_at(event.position()) != "pluck":
            event.ignore()
            return
        notches = (event.angleDelta().y() or event.angleDelta().x()) / 120
        if event.modifiers() & _Shift:
            self._turned += notches
            steps, self._turned = int(self._turned), self._turned - int(self._turned)
            if steps:
                self.shape_stepped.emit(steps)
        else:
            self.width_stepped.emit(notches)
        event.accept()

    def _take_key(self, key: Qt.Key, across: int, up: int, modifiers: Qt.KeyboardModifier) -> bool:
        """Move the pluck by arrows, 0.01 along or 0.5 mm up; with Ctrl set shape or width; reset it by Delete."""
        position, amplitude_mm = self._pluck.position, self._pluck.amplitude_mm
        if across and modifiers & _Control:
            self.shape_stepped.emit(across)
        elif up and modifiers & _Control:
            self.width_stepped.emit(float(up))
        elif across:
            self.pluck_drawn.emit(position + 0.01 * across, amplitude_mm)
        elif up:
            self.pluck_drawn.emit(position, amplitude_mm + 0.5 * (FINE if modifiers & _Shift else 1.0) * up)
        elif key == Qt.Key.Key_Delete:
            self.pluck_reset.emit()
        else:
            return False
        return True

    def _picture_part_at(self, at: QPointF) -> str | None:
        return "pluck" if (at - self._handle).manhattanLength() < 1.4 * GRAB_PIXELS else None

    # Geometry

    @property
    def axes(self) -> StringAxes:
        return StringAxes(self.width(), self.height(), self._span_mm)

    @property
    def _handle(self) -> QPointF:
        """The place of the handle. It is at the upper edge where a decayed motion's scale is less than the pluck."""
        return self.axes.at(self._pluck.position, min(self._pluck.amplitude_mm, self._span_mm))

    def _fit_span(self) -> None:
        """Fit the span, half the picture's height in mm, to the pluck or the motion; in a drag it only grows."""
        if self._drag == "pluck":
            self._span_mm = max(self._span_mm, _span_mm(self._pluck.amplitude_mm))
        elif self._frame is None:
            self._span_mm = _span_mm(self._pluck.amplitude_mm)
        else:
            largest_mm = self._frame.largest_mm(with_envelopes=self._plain)
            self._span_mm = max(_span_mm(largest_mm), min(self._span_mm, _span_mm(largest_mm, air=1.4)))

    # Painting

    def paintEvent(self, event: QPaintEvent) -> None:
        self._fit_span()
        super().paintEvent(event)

    def _paint_picture(self, painter: QPainter) -> None:
        if self._shown_motion is None:
            paint_pluck(painter, self.axes, self._pluck)
        else:
            paint_motion(painter, self.axes, self._shown_motion, self._heard, self._plain)
        paint_ends(painter, self.axes)

    def _paint_listening_line(self, painter: QPainter, x: float, colour: QColor) -> None:
        paint_listening_line(painter, self.axes, x, colour)

    def _point_words(self, point: float) -> str:
        return f"{point:.2f}"

    def _paint_over(self, painter: QPainter) -> None:
        axes, frame = self.axes, self._shown_motion
        grabbed = "pluck" in (self._drag, self._hovered)
        paint_handle(painter, self._handle, self._pluck, frame is None, grabbed, axes.x(1))
        if frame is not None and not self._plain:
            paint_caption(painter, QRectF(axes.x(0) + 10, axes.top + 4, axes.length - 20, 18), frame.caption)

    @property
    def _heard(self) -> str:
        return next((source.source for source in self._sources if source.heard), "")

    def _backdrop(self) -> QPixmap:
        """The ground, and the envelopes of a motion, painted again only when one of them changes."""
        frame = self._shown_motion
        ground = self._ground(self.axes, self._trained, self._pluck_end)
        if frame is None or not frame.envelopes:
            return ground
        made = self._swung
        if made is None or made[0] is not ground or made[1] is not frame.envelopes:
            # over the last one: to make another takes longer than to paint it
            picture = made[2] if made is not None and made[2].size() == ground.size() else QPixmap(ground.size())
            picture.setDevicePixelRatio(ground.devicePixelRatio())
            painter = QPainter(picture)
            painter.drawPixmap(0, 0, ground)
            self._paint_behind(painter)
            painter.end()
            self._swung = made = (ground, frame.envelopes, picture)
        return made[2]

    def _paint_behind(self, painter: QPainter) -> None:
        if (frame := self._shown_motion) is not None:
            paint_envelopes(painter, self.axes, frame.envelopes, self._heard)

    @property
    def _pluck_end(self) -> int | None:
        """The end of the string, 0 or 1, where words would be in the way of the pluck; None while motion is shown."""
        return int(self._pluck.position > 0.4) if self._shown_motion is None else None

    def _paint_ground(self, painter: QPainter) -> None:
        paint_ground(painter, self.axes, None if self._plain else self._trained, self._pluck_end)


def _span_mm(largest_mm: float, air: float = 1.15) -> float:
    """The least of SPANS_MM that is at least `air` times a displacement."""
    return next((span for span in SPANS_MM if span >= air * largest_mm), SPANS_MM[-1])
