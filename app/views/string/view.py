"""The string: what the slots hold in motion, the pluck that is being drawn, and the listening points.

A click on the string plucks it there with the last amplitude, a drag there with the amplitude of its end. The wheel
over the handle sets the width, with Shift the shape. Dragging a marker beneath the string moves a listening point. A
double-click on handle or marker resets it.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from PySide6.QtCore import QPointF, Qt, Signal
from PySide6.QtGui import QMouseEvent, QPainter, QPaintEvent, QPixmap, QWheelEvent
from PySide6.QtWidgets import QApplication, QWidget

from app.analysis.moment import StringFrame
from app.views.controls.plain import plain_tip
from app.views.stage import GRAB_PIXELS, StageView, paint_labels, paint_mark
from app.views.string.axes import StringAxes
from app.views.string.ground import TrainedPlucks, paint_ground
from app.views.string.ink import (
    ShownPluck,
    paint_caption,
    paint_ends,
    paint_envelopes,
    paint_handle,
    paint_listening_line,
    paint_motion,
    paint_pluck,
)

SPANS_MM = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)  # the display's half height, chosen to fit
FINE = 0.1  # with Shift
LEAST_DRAGGED_MM = 0.5  # so that a drag that ends on the string's line is heard
WORDS_HEIGHT = 29  # of the strip above the string: legend, warning and buttons

MARKER_TIP = "Drag to hear the string from another point; double-click resets. Shift and arrow keys move it"
TIPS: dict[str | None, str] = {  # by what the pointer is on
    None: "Click or drag to pluck the string; with Shift the drag is finer. Enter plucks again, F1 shows all keys",
    "pluck": "Drag along the string for the position, up and down for the amplitude; double-click resets.\n"
    "The wheel sets the width, with Shift the shape. Arrow keys do the same, with Ctrl for width and shape",
    "left": MARKER_TIP,
    "right": MARKER_TIP.replace("Shift", "Ctrl, Shift"),
}

_Shift = Qt.KeyboardModifier.ShiftModifier
_Control = Qt.KeyboardModifier.ControlModifier


class StringView(StageView):
    """Positions are shares of the string's length, displacements in mm; a `side` is "left" or "right"."""

    pluck_drawn = Signal(float, float)  # position, amplitude: while dragging
    pluck_released = Signal()
    pluck_reset = Signal()
    width_stepped = Signal(float)  # notches of the wheel
    shape_stepped = Signal(int)  # so many shapes on or back
    envelope_toggled = Signal(bool)

    CURSORS: ClassVar = {None: Qt.CursorShape.CrossCursor, "pluck": Qt.CursorShape.OpenHandCursor}

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("String", TIPS[None] or "", parent)
        self._frame: StringFrame | None = None
        self._pluck = ShownPluck(0.35, 4.0, np.zeros(2))
        self._trained = TrainedPlucks()
        self._span_mm = 5.0
        self._dragged = (0.0, 0.0)  # position and displacement in mm that the drag has come to, unlimited
        self._dragged_at = QPointF()
        self._pressed_at = QPointF()
        self._on_bare_string = False  # the press was not on a handle or a marker
        self._far = False  # the drag has gone too far from the press to be a click
        self._amplitude_mm = 0.0  # at its beginning
        self._on_handle_first = False  # the last press was the first of a series, and on the handle
        self._last_press_ms = -10_000
        self._turned = 0.0  # notches of the wheel towards the next shape
        self._backdrop: tuple[object, object, QPixmap] | None = None  # ground, envelopes, and both in one picture
        self._add_toggle("Motion", "Show the string in motion; off saves processor time (M)", self.motion_toggled)
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

    def set_shown(self, motion: bool, envelope: bool) -> None:
        """Set the state of both buttons; the frames given to `show_frame` should agree with it."""
        for button, on in zip(self._toggles, (motion, envelope), strict=True):
            button.setChecked(on)
        self._toggles[1].setEnabled(motion)

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
            self.update(0, WORDS_HEIGHT, self.width(), math.ceil(self._axes().bottom) - WORDS_HEIGHT)

    @property
    def _shows_pluck(self) -> bool:
        return self._frame is None or self._drag == "pluck"

    # Gestures

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() != Qt.MouseButton.LeftButton:
            return
        on = self._part_at(event.position())
        follows = event.timestamp() - self._last_press_ms < QApplication.doubleClickInterval()
        self._on_handle_first = on == "pluck" and not follows
        self._last_press_ms = event.timestamp()
        self._start_drag(on, event.position())

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        on = self._part_at(event.position())
        if event.button() != Qt.MouseButton.LeftButton:
            return
        if on in self._listening:
            self.listening_point_reset.emit(on)
        elif self._on_handle_first:
            self.pluck_reset.emit()
        else:  # the same place is plucked again and again
            self._last_press_ms = event.timestamp()
            self._start_drag(on, event.position())

    def _start_drag(self, on: str | None, at: QPointF) -> None:
        """Begin a drag of the pluck or of a mark, by its name, or a pluck on the bare string (None)."""
        if on is None or on == "pluck":  # at the scale of the pluck, not of the decayed motion
            self._span_mm = max(self._span_mm, _span_mm(self._pluck.amplitude_mm))
        axes = self._axes()
        self.drag_started.emit()
        self._drag = on or "pluck"
        self._dragged_at = self._pressed_at = at
        self._far = False
        self._on_bare_string = on is None
        self._amplitude_mm = self._pluck.amplitude_mm
        if on == "pluck":
            self._dragged = (self._pluck.position, self._pluck.amplitude_mm)
            self.setCursor(Qt.CursorShape.ClosedHandCursor)
        elif on is not None:
            self._dragged = (self._listening[on], 0.0)
        else:
            self._dragged = (axes.position(at.x()), axes.displacement_mm(at.y()))
            self.pluck_drawn.emit(self._dragged[0], self._amplitude_mm)  # a click does no more
        self.update()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        at = event.position()
        if self._drag is None:
            self._hover(self._part_at(at))
            self.setToolTip(
                plain_tip(self._warning) if at.y() < WORDS_HEIGHT and self._warning else TIPS[self._hovered]
            )
            return
        axes = self._axes()
        fine = FINE if event.modifiers() & _Shift else 1.0
        position, displacement_mm = self._dragged
        self._dragged = (
            position + fine * (axes.position(at.x()) - axes.position(self._dragged_at.x())),
            displacement_mm + fine * (axes.displacement_mm(at.y()) - axes.displacement_mm(self._dragged_at.y())),
        )
        self._dragged_at = at
        self._far |= (at - self._pressed_at).manhattanLength() >= QApplication.startDragDistance()
        if self._far or not self._on_bare_string:
            self._ask()

    def _ask(self) -> None:
        position, displacement_mm = self._dragged
        if self._drag == "pluck":
            least_mm = LEAST_DRAGGED_MM if self._far else min(LEAST_DRAGGED_MM, self._amplitude_mm)
            self.pluck_drawn.emit(position, max(abs(displacement_mm), least_mm))
            self._fit_span()
        elif self._drag is not None:
            self.listening_point_moved.emit(self._drag, position)

    def _drop(self, part: str) -> None:
        if part == "pluck":
            self.pluck_released.emit()

    def wheelEvent(self, event: QWheelEvent) -> None:
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

    def _part_at(self, at: QPointF) -> str | None:
        """The part that can be grabbed there: "pluck", a side, or None for the bare string."""
        axes = self._axes()
        if at.y() > axes.bottom - 6:
            return self._mark_under(at)
        handle = self._handle(axes)
        return "pluck" if (at - handle).manhattanLength() < 1.4 * GRAB_PIXELS else None

    # Geometry

    def _axes(self) -> StringAxes:
        return StringAxes(self.width(), self.height(), self._span_mm)

    def _handle(self, axes: StringAxes) -> QPointF:
        """The place of the handle. It is at the upper edge where a decayed motion's scale is less than the pluck."""
        return axes.at(self._pluck.position, min(self._pluck.amplitude_mm, self._span_mm))

    def _fit_span(self) -> None:
        """Set the span from the pluck at rest, or from the motion; while a pluck is dragged it only grows."""
        if self._drag == "pluck":
            self._span_mm = max(self._span_mm, _span_mm(self._pluck.amplitude_mm))
        elif self._frame is None:
            self._span_mm = _span_mm(self._pluck.amplitude_mm)
        else:
            largest_mm = self._frame.largest_mm(with_envelopes=self._plain)
            self._span_mm = max(_span_mm(largest_mm), min(self._span_mm, _span_mm(largest_mm, air=1.4)))

    # Painting

    def _mark_x(self, point: float) -> float:
        return self._axes().x(point)

    def paintEvent(self, event: QPaintEvent) -> None:
        self._fit_span()
        axes = self._axes()
        painter = QPainter(self)
        painter.drawPixmap(0, 0, self._backdrop_picture(axes))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if self._frame is None or self._drag == "pluck":
            paint_pluck(painter, axes, self._pluck)
        else:
            paint_motion(painter, axes, self._frame, self._heard, self._plain)
        paint_ends(painter, axes)
        below = event.rect().bottom() > axes.bottom  # what lies there is painted again
        for side, position in self._listening.items():
            grabbed = side in (self._drag, self._hovered)
            paint_listening_line(painter, axes, position, grabbed)
            if below:
                paint_mark(painter, axes.x(position), axes.bottom, grabbed)
        if below and self._listening:
            points = {"listen": self._listening["left"]} if len(self._listening) == 1 else self._listening
            labels = [(axes.x(position), f"{label} {position:.2f}") for label, position in points.items()]
            paint_labels(painter, labels, axes.width, axes.bottom)
        grabbed = "pluck" in (self._drag, self._hovered)
        paint_handle(painter, self._handle(axes), self._pluck, self._shows_pluck, grabbed, axes.x(1))
        if self._frame is not None and not self._shows_pluck and not self._plain:
            paint_caption(painter, axes, self._frame)

    @property
    def _heard(self) -> str:
        return next((source.source for source in self._sources if source.heard), "")

    def _backdrop_picture(self, axes: StringAxes) -> QPixmap:
        """The ground, and the envelopes of a motion, painted again only when one of them changes."""
        ground = self._ground(axes)
        if self._frame is None or self._shows_pluck or not self._frame.envelopes:
            return ground
        envelopes = self._frame.envelopes
        if self._backdrop is None or self._backdrop[0] is not ground or self._backdrop[1] is not envelopes:
            picture = None if self._backdrop is None else self._backdrop[2]
            if picture is None or picture.size() != ground.size():
                picture = QPixmap(ground.size())
            picture.setDevicePixelRatio(ground.devicePixelRatio())
            painter = QPainter(picture)  # over the last one: to make another takes longer than to paint it
            painter.drawPixmap(0, 0, ground)
            paint_envelopes(painter, axes, envelopes, self._heard)
            painter.end()
            self._backdrop = (ground, envelopes, picture)
        return self._backdrop[2]

    def _ground(self, axes: StringAxes) -> QPixmap:
        return self._ground_of(axes, self._trained, self._shown_pluck)

    @property
    def _shown_pluck(self) -> int | None:
        """The side on which words would be in the way of the pluck, with the words at its handle."""
        return int(self._pluck.position > 0.4) if self._shows_pluck else None

    def _paint_ground(self, painter: QPainter) -> None:
        paint_ground(painter, self._axes(), None if self._plain else self._trained, self._shown_pluck)


def _span_mm(largest_mm: float, air: float = 1.15) -> float:
    """The least of SPANS_MM that is at least `air` times a displacement."""
    return next((span for span in SPANS_MM if span >= air * largest_mm), SPANS_MM[-1])
