"""The frame that pictures of string and drum share: backdrop, legend, buttons, and marks of listening points."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal, SignalInstance
from PySide6.QtGui import (
    QColor,
    QFontMetrics,
    QKeyEvent,
    QLinearGradient,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPixmap,
    QPolygonF,
    QResizeEvent,
)
from PySide6.QtWidgets import QSizePolicy, QToolButton, QWidget

from app.session.shown import DEFAULT_SOURCES, ShownSource
from app.views import theme
from app.views.controls.parts import tool_button
from app.views.controls.plain import plain_tip
from app.views.painting import set_ink, write
from app.views.plots.legend import paint_sources
from engine.pluck import DEFAULT_LISTEN

MARGIN_X = 54  # pixels around the picture
MARGIN_TOP = 38
MARGIN_BOTTOM = 40
LEGEND_Y = 17.5  # the middle of the line above the picture
LEGEND_SHARE = 0.45  # of that line, which a warning leaves to the legend
WORDS_HEIGHT = 29  # pixels of the strip above the picture: legend, warning and buttons
GRAB_PIXELS = 14  # how near a mark counts as on it
ARROWS = {Qt.Key.Key_Left: (-1, 0), Qt.Key.Key_Right: (1, 0), Qt.Key.Key_Up: (0, 1), Qt.Key.Key_Down: (0, -1)}
STEP = 0.01  # of a listening point, for a key
FINE = 0.1  # of a drag, with Shift
FOOT = 8.0  # pixels: half the width of a mark
LABEL_GAP = 8  # pixels between the words of two marks
SIDES = ("left", "right")

_Shift = Qt.KeyboardModifier.ShiftModifier
_Control = Qt.KeyboardModifier.ControlModifier


@dataclass(frozen=True)
class StageAxes:
    """The axes of a picture in a widget of `width` × `height` pixels."""

    width: int
    height: int

    @property
    def bottom(self) -> float:
        """The height at which the feet of listening points stand."""
        return self.height - MARGIN_BOTTOM

    @abstractmethod
    def x(self, point: float) -> float:
        """The x of a listening point, in pixels."""


class StageView(QWidget):
    """A picture above the decks, of the motions that the slots A and B hold: of sources such as model and truth.

    A listening point is where the sound is taken from, 0 … 1 across the picture: one for each `side`, the channels
    "left" and "right". Its mark stands beneath the picture. A part is what a press would take: the mark of a side
    (named as the side), or what the picture has. Dragging a mark moves its listening point, with Shift more finely.
    A double-click resets it.
    """

    listening_point_moved = Signal(str, float)  # side, point
    listening_point_reset = Signal(str)  # side
    drag_started = Signal()
    drag_ended = Signal()
    motion_toggled = Signal(bool)

    NAME: ClassVar[str]
    ELSEWHERE: ClassVar[str]  # to which a mark is dragged, after "from"
    MARK_NAMES: ClassVar[dict[str, str]]  # by side, where there are two
    CURSORS: ClassVar[dict[str | None, Qt.CursorShape]]  # by part, without the marks; None: on nothing
    TIPS: ClassVar[dict[str | None, str]]  # the same

    def __init__(self, parent: QWidget | None) -> None:
        super().__init__(parent)
        self.setMinimumSize(480, 112)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setAccessibleName(self.NAME)
        name = self.NAME.lower()
        mark = f"Drag to hear the {name} from {self.ELSEWHERE}; double-click resets. Shift and arrow keys move it"
        self._tips = {**self.TIPS, "left": mark, "right": mark.replace("Shift", "Ctrl, Shift")}
        self.setToolTip(self._tips[None])
        self._listening: dict[str, float] = {"left": DEFAULT_LISTEN}  # side -> point; without those that have no mark
        self._warning, self._grave = "", True  # as of `set_warning`
        self._sources: tuple[ShownSource, ...] = DEFAULT_SOURCES
        self._drag: str | None = None  # the part that is dragged
        self._dragged_at = QPointF()  # of the mouse, at its last move
        self._dragged_point = 0.0  # that the mark has come to, unlimited
        self._hovered: str | None = None  # the part under the mouse; None: none
        self._plain = False  # without scale, legend and time, as in Play
        self._ground_pixmap: QPixmap | None = None  # what `_ground` has painted; None: nothing yet
        self._ground_key: tuple[object, ...] = ()  # all that it was painted from
        self._toggles: list[QToolButton] = []  # Motion, then what a subclass adds, from left to right
        self._add_toggle("Motion", f"Show the {name} in motion; off saves processor time (M)", self.motion_toggled)

    def _add_toggle(self, text: str, tip: str, toggled: SignalInstance) -> None:
        button = tool_button(text, text, tip, "chip", toggled, checkable=True)
        button.setParent(self)
        button.setCursor(Qt.CursorShape.ArrowCursor)
        self._toggles.append(button)

    @property
    @abstractmethod
    def axes(self) -> StageAxes:
        """Places on the picture, in pixels."""

    # State

    def set_warning(self, text: str, grave: bool = True) -> None:
        """Set the reason why there is no sound, or what is wrong with it.

        "" is for neither; `grave`: in the colour of warnings.
        """
        self._warning, self._grave = text, grave
        self.update()

    def set_plain(self, plain: bool) -> None:
        """Draw string or drum alone, without scale, legend, time and buttons; else with these."""
        self._plain = plain
        for button in self._toggles:
            button.setVisible(not plain)
        self.update()

    def set_shown(self, motion: bool, envelope: bool = False) -> None:
        """Set the state of the buttons; the frames given to `show_frame` should agree with it."""
        for button, on in zip(self._toggles, (motion, envelope), strict=False):
            button.setChecked(on)
        for button in self._toggles[1:]:
            button.setEnabled(motion)

    def set_sources(self, sources: tuple[ShownSource, ...]) -> None:
        """Set the sources that the slots hold; the frames given to `show_frame` should have these motions."""
        self._sources = sources
        self.update()

    @abstractmethod
    def show_frame(self, frame: Any) -> None:
        """Show a moment of the motion; None: at rest."""

    def set_listening_points(self, left: float | None, right: float | None = None) -> None:
        """Set the listening points, 0 … 1; None: it has no mark, as the right one in mono, or both at a bridge."""
        points = {"left": left, "right": right}
        self._listening = {side: position for side, position in points.items() if position is not None}
        self.update()

    # Gestures

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Begin to drag the mark under the left button, or hand the press to the picture."""
        if event.button() != Qt.MouseButton.LeftButton:
            return
        part = self._part_at(event.position())
        if part in self._listening:
            self._dragged_point = self._listening[part]
            self._start_drag(part, event.position())
        else:
            self._press(part, event)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """Reset the listening point of the mark there, or hand the press to the picture."""
        part = self._part_at(event.position())
        if event.button() != Qt.MouseButton.LeftButton:
            return
        if part in self._listening:
            self.listening_point_reset.emit(part)
        else:
            self._press_again(part, event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Move the part that is dragged; otherwise light the part under the mouse, with its tooltip."""
        at = event.position()
        if self._drag is None:
            self._hover(self._part_at(at))
            on_warning = self._warning and at.y() < WORDS_HEIGHT
            self.setToolTip(plain_tip(self._warning) if on_warning else self._tips[self._hovered])
            return
        by = (at - self._dragged_at) * (FINE if event.modifiers() & _Shift else 1.0)
        self._dragged_at = at
        if self._drag in SIDES:
            self._dragged_point += by.x() / (self.axes.x(1.0) - self.axes.x(0.0))
            self.listening_point_moved.emit(self._drag, min(max(self._dragged_point, 0.0), 1.0))
        else:
            self._drag_on(at, by)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """End the drag: emit `drag_ended`, then call `_drop` with the part that was dragged."""
        if event.button() != Qt.MouseButton.LeftButton or self._drag is None:
            return
        dragged, self._drag = self._drag, None
        self.drag_ended.emit()
        self._drop(dragged)
        self._hover(self._part_at(event.position()))
        self.update()

    def leaveEvent(self, event: QEvent) -> None:
        if self._drag is None:
            self._hover(None)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Move a listening point by Shift with arrows, reset them by Shift with Delete; others are the picture's."""
        key, modifiers = Qt.Key(event.key()), event.modifiers()
        across, up = ARROWS.get(key, (0, 0))
        if across and modifiers & _Shift:
            self._step_mark("right" if modifiers & _Control else "left", across)
        elif key == Qt.Key.Key_Delete and modifiers & _Shift:
            for side in self._listening:
                self.listening_point_reset.emit(side)
        elif not self._take_key(key, across, up, modifiers):
            super().keyPressEvent(event)

    def _start_drag(self, part: str, at: QPointF) -> None:
        self.drag_started.emit()
        self._drag, self._dragged_at = part, at
        self.update()

    @abstractmethod
    def _press(self, part: str | None, event: QMouseEvent) -> None:
        """Take a press on a part of the picture, or on none."""

    def _press_again(self, part: str | None, event: QMouseEvent) -> None:
        """Take the second press of a double-click."""
        self._press(part, event)

    def _drag_on(self, at: QPointF, by: QPointF) -> None:
        """Drag a part of the picture; `at`: the mouse, `by`: its way in pixels, times FINE with Shift."""

    def _drop(self, part: str) -> None:
        """End the drag of a part."""

    @abstractmethod
    def _take_key(self, key: Qt.Key, across: int, up: int, modifiers: Qt.KeyboardModifier) -> bool:
        """Take a key; return False where it means nothing here.

        `across`, `up`: the direction of an arrow, -1 or 1 (right, up); 0 for both where it is no arrow.
        """

    def _part_at(self, at: QPointF) -> str | None:
        """The part that can be grabbed at a point: the picture's, or below it the nearest mark; None: none."""
        if at.y() <= self.axes.bottom - 6:
            return self._picture_part_at(at)
        near = {side: abs(at.x() - self.axes.x(point)) for side, point in self._listening.items()}
        side = min(near, key=lambda name: near[name], default=None)
        return side if side is not None and near[side] < GRAB_PIXELS else None

    @abstractmethod
    def _picture_part_at(self, at: QPointF) -> str | None:
        """The part of the picture at a point, which lies above the marks; None: none."""

    def _hover(self, part: str | None) -> None:
        """Show the mouse's cursor for the part under it (None: none), and light that part."""
        self.setCursor(self.CURSORS.get(part, Qt.CursorShape.SizeHorCursor))
        if part != self._hovered:
            self._hovered = part
            self.update()

    def _step_mark(self, side: str, steps: int) -> None:
        """Ask to move a listening point by `steps` of STEP to the right, within 0 … 1; nothing without a mark."""
        if side in self._listening:
            self.listening_point_moved.emit(side, min(max(self._listening[side] + STEP * steps, 0.0), 1.0))

    # Painting

    def sizeHint(self) -> QSize:
        return QSize(1100, 330)

    def resizeEvent(self, event: QResizeEvent) -> None:
        right = self.width() - MARGIN_X
        for button in reversed(self._toggles):
            size = button.sizeHint()
            right -= size.width()
            button.setGeometry(right, 6, size.width(), theme.px(22))
            right -= 6

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.drawPixmap(0, 0, self._backdrop())
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self._paint_front(painter, event.rect().bottom() > self.axes.bottom)  # what lies there is painted again

    def paint_figure(self, painter: QPainter) -> None:
        """Paint all but the buttons."""
        self._paint_scenery(painter)
        self._paint_behind(painter)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self._paint_front(painter, True)

    def _paint_front(self, painter: QPainter, below: bool) -> None:
        """Paint string or drum and all that lies above it; `below`: the marks beneath it too."""
        axes = self.axes
        self._paint_picture(painter)
        labels = []
        for side, point in self._listening.items():
            x, grabbed = axes.x(point), side in (self._drag, self._hovered)
            self._paint_listening_line(painter, x, theme.translucent(theme.GOOD, 190 if grabbed else 120))
            if below:
                paint_mark(painter, x, axes.bottom, grabbed)
            name = "listen" if len(self._listening) == 1 else self.MARK_NAMES[side]
            labels.append((x, f"{name} {self._point_words(point)}"))
        if below and labels:
            paint_labels(painter, labels, axes.width, axes.bottom)
        self._paint_over(painter)

    def _backdrop(self) -> QPixmap:
        """The picture behind all that moves."""
        return self._ground()

    def _paint_behind(self, painter: QPainter) -> None:
        """Paint what lies between the ground and string or drum."""

    @abstractmethod
    def _paint_picture(self, painter: QPainter) -> None:
        """Paint string or drum."""

    @abstractmethod
    def _paint_listening_line(self, painter: QPainter, x: float, colour: QColor) -> None:
        """Paint the line from the picture to the mark of a listening point."""

    @abstractmethod
    def _point_words(self, point: float) -> str:
        """The words for a listening point at its mark."""

    def _paint_over(self, painter: QPainter) -> None:
        """Paint what lies above the marks."""

    def _paint_ground(self, painter: QPainter) -> None:
        """Paint the ground behind the motion, on the backdrop."""

    def _ground(self, *chosen: object) -> QPixmap:
        """The picture of backdrop, ground and legend, painted again only when one of its causes has changed.

        `chosen`: what a subclass paints the ground from, besides the causes known here.
        """
        key = (
            self.size(),
            self.devicePixelRatioF(),
            self._sources,
            self._warning,
            self._grave,
            self._plain,
            theme.present,
            self.hasFocus(),
            *chosen,
        )
        if self._ground_pixmap is None or self._ground_key != key:
            pixmap = QPixmap(self.size() * self.devicePixelRatioF() + QSize(1, 1))  # at 125 % it ends within a pixel
            pixmap.setDevicePixelRatio(self.devicePixelRatioF())
            pixmap.fill(QColor(theme.BACKGROUND))
            painter = QPainter(pixmap)
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            self._paint_scenery(painter)
            if self.hasFocus():
                set_ink(painter, theme.translucent(theme.TEXT, 150), 1.5)
                painter.drawRoundedRect(QRectF(self.rect()).adjusted(1, 1, -1, -1), 6, 6)
            painter.end()
            self._ground_pixmap, self._ground_key = pixmap, key
        return self._ground_pixmap

    def _paint_scenery(self, painter: QPainter) -> None:
        """Paint backdrop, ground and legend."""
        paint_backdrop(painter, self.width(), self.height())
        self._paint_ground(painter)
        if not self._plain:
            colour = theme.WARNING if self._grave else theme.FAINT
            paint_legend(painter, self._sources, self._warning, colour, self._toggles[0].x() - 14)
        else:
            others = (source.title for source in self._sources if source.heard and source.source != "model")
            heard = next((f"You hear: {title}" for title in others), "")  # there is no legend
            paint_remark(painter, self.width(), self._warning or heard)


def paint_backdrop(painter: QPainter, width: float, height: float) -> None:
    """Paint the gradient behind a string or a drum, with a frame."""
    gradient = QLinearGradient(0, 0, 0, height)
    gradient.setColorAt(0, QColor(theme.present.ground_top))
    gradient.setColorAt(1, QColor(theme.present.ground_bottom))
    set_ink(painter, theme.LINE, fill=gradient)
    painter.drawRoundedRect(QRectF(0.5, 0.5, width - 1, height - 1), 6, 6)


def paint_legend(
    painter: QPainter, sources: tuple[ShownSource, ...], warning: str, colour: str, right: float
) -> None:
    """Paint the sources and, to their right, the warning in its colour, as far as `right` in pixels.

    Where both do not fit, the titles of the sources are cut first, but they keep LEGEND_SHARE of the line.
    """
    warned = QFontMetrics(theme.small_font(11)).horizontalAdvance(warning) + 8 if warning else 0
    room = right - MARGIN_X
    x = paint_sources(painter, sources, MARGIN_X, LEGEND_Y, MARGIN_X + max(room - warned, LEGEND_SHARE * room))
    if warning:
        place = QRectF(x, LEGEND_Y - 10, max(0.0, right - x - 8), 20)
        align = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
        write(painter, place, warning, colour, theme.small_font(11), align, place.width())


def paint_remark(painter: QPainter, width: float, text: str) -> None:
    """Paint a line in the upper left corner, why nothing is heard."""
    room = width - 2 * MARGIN_X
    place = QRectF(MARGIN_X, LEGEND_Y - 10, room, 20)
    write(painter, place, text, theme.FAINT, theme.small_font(11), Qt.AlignmentFlag.AlignVCenter, room)


def paint_mark(painter: QPainter, x: float, bottom: float, grabbed: bool) -> None:
    """Paint the foot of a listening point, below the picture."""
    set_ink(painter, theme.TEXT if grabbed else None, 1.5, theme.GOOD)
    painter.drawPolygon(
        QPolygonF([QPointF(x, bottom + 2), QPointF(x - FOOT, bottom + 15), QPointF(x + FOOT, bottom + 15)])
    )


def paint_caption(painter: QPainter, place: QRectF, text: str) -> None:
    """Paint the time that is shown, at the right of its place."""
    align = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
    write(painter, place, text, theme.TEXT, theme.small_font(12), align, place.width())


def paint_labels(painter: QPainter, marks: Sequence[tuple[float, str]], width: float, bottom: float) -> None:
    """Paint the words of marks, (x in pixels, words) each, below their feet; neighbours make room for one another."""
    font = theme.small_font(11)
    for place, text in label_places(QFontMetrics(font), marks, width, bottom):
        write(painter, place, text, theme.GOOD, font)


def label_places(
    metrics: QFontMetrics, marks: Sequence[tuple[float, str]], width: float, bottom: float
) -> list[tuple[QRectF, str]]:
    """The box of each label: under its mark, but within `width` and clear of its neighbour; all in pixels.

    `marks`: (x, words), at least one. `bottom`: the height at which feet stand.
    """
    texts = sorted(marks)
    widths = [metrics.horizontalAdvance(text) + 2 for _, text in texts]
    lefts = [x - width_px / 2 for (x, _), width_px in zip(texts, widths, strict=True)]
    for second in range(1, len(texts)):
        overlap = max(0.0, lefts[second - 1] + widths[second - 1] + LABEL_GAP - lefts[second])
        lefts[second - 1] -= overlap / 2
        lefts[second] += overlap / 2
    right = lefts[-1] + widths[-1]
    aside = max(0.0, -lefts[0]) + min(0.0, width - right)  # moves all back within the widget
    return [
        (QRectF(left + aside, bottom + 16, label_width, 18), text)
        for left, label_width, (_, text) in zip(lefts, widths, texts, strict=True)
    ]
