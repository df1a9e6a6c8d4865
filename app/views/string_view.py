"""The string: model and truth in motion, the pluck that is being drawn, and the listening point.

Drag on the string: where and how far it is pulled. Drag the marker beneath it: where it is heard.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QKeyEvent,
    QLinearGradient,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QPixmap,
    QPolygonF,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.views import theme
from engine.pluck import DEFAULT_LISTEN

MARGIN_X = 46
MARGIN_TOP = 34
MARGIN_BOTTOM = 40
SPANS_MM = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)  # the display's half height, chosen to fit
GRAB_PIXELS = 14  # how near the marker counts as on it


@dataclass(frozen=True)
class StringFrame:
    """What the string looks like at one moment; displacements (points,) in mm.

    Attributes:
        shapes: by source.
        lowest, highest: by source, the extremes since the last frame: the blur of a string in real time.
    """

    shapes: dict[str, NDArray[np.float32]]
    lowest: dict[str, NDArray[np.float32]]
    highest: dict[str, NDArray[np.float32]]
    caption: str = ""
    past_horizon: bool = False


class StringView(QWidget):
    """See the module. Positions are in lengths, displacement in mm."""

    pluck_drawn = Signal(float, float)  # position, amplitude: while dragging
    pluck_released = Signal()
    listening_point_moved = Signal(float)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setMinimumSize(480, 200)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        self.setAccessibleName("String")
        self.setToolTip(
            "Drag the string to pluck it; drag the marker below to move the listening point.\n"
            "Arrow keys move the pluck, with Shift the listening point; Enter plucks"
        )
        self._frame: StringFrame | None = None
        self._preview_mm: NDArray[np.float64] | None = None
        self._pluck = (0.35, 4.0)
        self._listen = DEFAULT_LISTEN
        self._listen_right: float | None = None
        self._trained: tuple[float, float] | None = None
        self._warning = ""
        self._heard = "model"
        self._span_mm = 5.0
        self._drag: str | None = None  # "pluck" or "listen"
        self._ground_pixmap: QPixmap | None = None
        self._ground_key: tuple[object, ...] = ()

    # What is shown

    def set_pluck(self, position: float, amplitude_mm: float, shape_mm: NDArray[np.float64]) -> None:
        """The pluck as chosen; it is drawn while no motion is shown."""
        self._pluck = (position, amplitude_mm)
        self._preview_mm = shape_mm
        self.update()

    def set_listening_point(self, listen: float, right: float | None = None) -> None:
        """The listening point; in stereo the left one, and the right one beside it."""
        self._listen, self._listen_right = listen, right
        self.update()

    def set_trained_positions(self, trained: tuple[float, float] | None) -> None:
        """The pluck positions that the model was trained on; None: everywhere."""
        self._trained = trained
        self.update()

    def set_warning(self, text: str) -> None:
        """Why this pluck is silent, or outside what the model knows."""
        self._warning = text
        self.update()

    def set_heard(self, source: str) -> None:
        self._heard = source
        self.update()

    def show_frame(self, frame: StringFrame | None) -> None:
        """A moment of the motion; None goes back to the pluck."""
        self._frame = frame
        self.update()

    @property
    def is_dragging_pluck(self) -> bool:
        return self._drag == "pluck"

    # Gestures

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() != Qt.MouseButton.LeftButton:
            return
        self._drag = "listen" if self._on_marker(event.position()) else "pluck"
        self._follow(event.position())

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._drag is None:
            on_marker = self._on_marker(event.position())
            self.setCursor(Qt.CursorShape.SizeHorCursor if on_marker else Qt.CursorShape.CrossCursor)
        else:
            self._follow(event.position())

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        drag, self._drag = self._drag, None
        if drag == "pluck":
            self.pluck_released.emit()
        self.update()

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        if self._on_marker(event.position()):
            self.listening_point_moved.emit(DEFAULT_LISTEN)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        shift = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
        sideways = {Qt.Key.Key_Left: -0.01, Qt.Key.Key_Right: 0.01}.get(Qt.Key(event.key()))
        upwards = {Qt.Key.Key_Up: 0.5, Qt.Key.Key_Down: -0.5}.get(Qt.Key(event.key()))
        position, amplitude_mm = self._pluck
        if sideways is not None and shift:
            self.listening_point_moved.emit(self._listen + sideways)
        elif sideways is not None:
            self.pluck_drawn.emit(position + sideways, amplitude_mm)
        elif upwards is not None:
            self.pluck_drawn.emit(position, amplitude_mm + upwards)
        else:
            super().keyPressEvent(event)

    def _follow(self, at: QPointF) -> None:
        position = (at.x() - MARGIN_X) / max(1.0, self._width())
        if self._drag == "listen":
            self.listening_point_moved.emit(position)
        else:
            up = abs(self._middle() - at.y()) / self._half_height()
            self.pluck_drawn.emit(position, up * self._span_mm)

    def _on_marker(self, at: QPointF) -> bool:
        return at.y() > self.height() - MARGIN_BOTTOM - 6 and abs(at.x() - self._x(self._listen)) < GRAB_PIXELS

    # Geometry

    def _width(self) -> float:
        return self.width() - 2 * MARGIN_X

    def _x(self, position: float) -> float:
        return MARGIN_X + position * self._width()

    def _middle(self) -> float:
        return (MARGIN_TOP + self.height() - MARGIN_BOTTOM) / 2

    def _half_height(self) -> float:
        return (self.height() - MARGIN_TOP - MARGIN_BOTTOM) / 2

    def _y(self, displacement_mm: float) -> float:
        return self._middle() - displacement_mm / self._span_mm * self._half_height()

    def _curve(self, displacement_mm: NDArray[np.floating]) -> QPolygonF:
        xs = np.linspace(self._x(0), self._x(1), len(displacement_mm)).tolist()
        ys = (self._middle() - displacement_mm / self._span_mm * self._half_height()).tolist()
        return QPolygonF([QPointF(x, y) for x, y in zip(xs, ys, strict=True)])

    def _fit_span(self) -> None:
        """Steps to a span that holds the pluck, or follows the decay; while a pluck is drawn it can only grow."""
        if self._frame is None or self._drag == "pluck":
            largest_mm = self._pluck[1]
        else:
            bands = [*self._frame.lowest.values(), *self._frame.highest.values()]
            largest_mm = max(float(np.abs(band).max()) for band in bands)
        wanted = next((s for s in SPANS_MM if s >= 1.15 * largest_mm), SPANS_MM[-1])
        too_small = wanted > self._span_mm
        much_too_large = self._drag != "pluck" and 1.4 * largest_mm < wanted < self._span_mm
        if too_small or much_too_large:
            self._span_mm = wanted

    # Painting

    def sizeHint(self) -> QSize:
        return QSize(1100, 330)

    def paintEvent(self, event: QPaintEvent) -> None:
        self._fit_span()
        painter = QPainter(self)
        painter.drawPixmap(0, 0, self._ground())
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if self._drag == "pluck" or self._frame is None:
            self._paint_pluck(painter)
        else:
            self._paint_motion(painter, self._frame)
        self._paint_ends(painter)
        self._paint_listening_points(painter)
        self._paint_words(painter)

    def _ground(self) -> QPixmap:
        """The picture behind the string, painted anew only when something in it changes."""
        key = (self.size(), self.devicePixelRatioF(), self._span_mm, self._trained)
        if self._ground_pixmap is None or self._ground_key != key:
            pixmap = QPixmap(self.size() * self.devicePixelRatioF())
            pixmap.setDevicePixelRatio(self.devicePixelRatioF())
            pixmap.fill(QColor(theme.BACKGROUND))
            painter = QPainter(pixmap)
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            self._paint_ground(painter)
            painter.end()
            self._ground_pixmap, self._ground_key = pixmap, key
        return self._ground_pixmap

    def _paint_ground(self, painter: QPainter) -> None:
        gradient = QLinearGradient(0, 0, 0, self.height())
        gradient.setColorAt(0, QColor("#171b22"))
        gradient.setColorAt(1, QColor("#101317"))
        painter.setPen(QPen(QColor(theme.LINE), 1))
        painter.setBrush(gradient)
        painter.drawRoundedRect(QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5), 6, 6)
        top, bottom = self._middle() - self._half_height(), self._middle() + self._half_height()
        painter.setFont(theme.small_font(10))
        for tenth in range(11):
            x = self._x(tenth / 10)
            painter.setPen(QPen(theme.translucent(theme.LINE, 110), 1))
            painter.drawLine(QPointF(x, top), QPointF(x, bottom))
        for share in (-1, -0.5, 0, 0.5, 1):
            y = self._middle() - share * self._half_height()
            painter.setPen(QPen(theme.translucent(theme.LINE, 160 if share == 0 else 80), 1))
            painter.drawLine(QPointF(self._x(0), y), QPointF(self._x(1), y))
            painter.setPen(QColor(theme.FAINT))
            label = f"{share * self._span_mm:+g}" if share else "0 mm"
            painter.drawText(
                QRectF(0, y - 8, MARGIN_X - 6, 16),
                Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter,
                label,
            )
        if self._trained is not None:
            self._paint_untrained(painter, top, bottom)

    def _paint_untrained(self, painter: QPainter, top: float, bottom: float) -> None:
        assert self._trained is not None
        low, high = self._trained
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(0, 0, 0, 70))
        left = QRectF(self._x(0), top, self._x(low) - self._x(0), bottom - top)
        right = QRectF(self._x(high), top, self._x(1) - self._x(high), bottom - top)
        for area in (left, right):
            painter.drawRect(area)
        painter.setPen(theme.translucent(theme.FAINT, 150))
        painter.setFont(theme.small_font(10))
        for area in (left, right):
            painter.drawText(
                area.adjusted(4, 0, -4, -4),
                Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignBottom,
                "not trained here",
            )

    def _paint_pluck(self, painter: QPainter) -> None:
        if self._preview_mm is None:
            return
        curve = self._curve(self._preview_mm)
        for colour, width in ((theme.translucent(theme.TEXT, 50), 6.4), (QColor(theme.TEXT), 2.0)):
            painter.setPen(QPen(colour, width))
            painter.drawPolyline(curve)
        at = QPointF(self._x(self._pluck[0]), self._y(self._pluck[1]))
        painter.setPen(QPen(QColor(theme.BACKGROUND), 2))
        painter.setBrush(QColor(theme.TEXT))
        painter.drawEllipse(at, 6, 6)
        text = f"{self._pluck[0]:.2f}   {self._pluck[1]:.1f} mm"
        painter.setFont(theme.small_font(12))
        painter.setPen(QColor(theme.TEXT))
        beside = at.x() + 12 if at.x() < self.width() - 140 else at.x() - 122
        painter.drawText(QRectF(beside, at.y() - 9, 110, 18), Qt.AlignmentFlag.AlignVCenter, text)

    def _paint_motion(self, painter: QPainter, frame: StringFrame) -> None:
        order = sorted(frame.shapes, key=lambda name: name == self._heard)
        for name in order:
            colour = theme.SOURCE_COLOURS[name]
            band = self._curve(frame.lowest[name])
            for point in reversed(self._curve(frame.highest[name]).toList()):
                band.append(point)
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(theme.translucent(colour, 46 if name == self._heard else 26))
            painter.drawPolygon(band)
        for name in order:
            heard = name == self._heard
            painter.setPen(QPen(QColor(theme.SOURCE_COLOURS[name]), 2.4 if heard else 1.6))
            painter.drawPolyline(self._curve(frame.shapes[name]))

    def _paint_ends(self, painter: QPainter) -> None:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(theme.FAINT))
        for x in (self._x(0), self._x(1)):
            painter.drawRoundedRect(QRectF(x - 3, self._middle() - 22, 6, 44), 3, 3)

    def _paint_listening_points(self, painter: QPainter) -> None:
        if self._listen_right is None:
            self._paint_listening_point(painter, self._listen, "listen")
        else:
            self._paint_listening_point(painter, self._listen_right, "right")
            self._paint_listening_point(painter, self._listen, "left")

    def _paint_listening_point(self, painter: QPainter, listen: float, name: str) -> None:
        x = self._x(listen)
        bottom = self._middle() + self._half_height()
        painter.setPen(QPen(theme.translucent(theme.GOOD, 120), 1, Qt.PenStyle.DashLine))
        painter.drawLine(QPointF(x, self._middle() - self._half_height()), QPointF(x, bottom))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(theme.GOOD))
        painter.drawPolygon(
            QPolygonF([QPointF(x, bottom + 2), QPointF(x - 8, bottom + 15), QPointF(x + 8, bottom + 15)])
        )
        painter.setPen(QColor(theme.GOOD))
        painter.setFont(theme.small_font(11))
        painter.drawText(QRectF(x - 60, bottom + 16, 120, 18), Qt.AlignmentFlag.AlignCenter, f"{name} {listen:.2f}")

    def _paint_words(self, painter: QPainter) -> None:
        painter.setFont(theme.small_font(12, bold=True))
        x = float(MARGIN_X)
        names = ["model", "truth"]
        for name in names if self._heard in names else [*names, self._heard]:
            heard = name == self._heard
            hue = theme.SOURCE_COLOURS[theme.source_kind(name)]
            colour = QColor(hue) if heard else theme.translucent(hue, 140)
            painter.setPen(QPen(colour, 3))
            painter.drawLine(QPointF(x, 18), QPointF(x + 18, 18))
            text = f"{name.removeprefix('preset:')} (heard)" if heard else name
            painter.drawText(QPointF(x + 24, 22), text)
            x += 44 + painter.fontMetrics().horizontalAdvance(text)
        if self._warning:
            painter.setPen(QColor(theme.WARNING))
            painter.setFont(theme.small_font(11))
            painter.drawText(QPointF(x + 8, 22), self._warning)
        if self._frame is not None and self._drag != "pluck":
            painter.setFont(theme.small_font(12))
            painter.setPen(QColor(theme.WARNING if self._frame.past_horizon else theme.FAINT))
            text = self._frame.caption + ("   past training" if self._frame.past_horizon else "")
            area = QRectF(self.width() / 2, 8, self.width() / 2 - MARGIN_X, 20)
            painter.drawText(area, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter, text)
