"""Base of the piano keys and the neck: a surface of keys played with the mouse or with Enter."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import NamedTuple

from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QFocusEvent,
    QFontMetricsF,
    QHideEvent,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPixmap,
    QResizeEvent,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.shared.key_names import note_name
from app.views import theme
from app.views.controls.parts import ENTER_KEYS, keeps_keys
from app.views.painting import set_ink, write

LOWEST, HEIGHT = 72, 104  # of a surface in a low window, and otherwise, in pixels
SOFTEST, HARDEST = 40, 127  # velocities of a click at the top and at the bottom of a place
TIP_MS = 5_000  # the tooltip covers keys
TYPED = 96  # velocity of the Enter key
FIGURE_BESIDE = 14  # pixels from the mouse to the figure of its velocity
LEVEL_STEPS = 24  # that can be distinguished; finer changes are not painted
_MOVES = {Qt.Key.Key_Right: 1, Qt.Key.Key_Left: -1, Qt.Key.Key_Up: 12, Qt.Key.Key_Down: -12}


class Spot(NamedTuple):
    """The spot that a finger presses: a key, and on a neck its string.

    Strings count from the highest, 0; None: the key chooses it.
    """

    key: int
    string: int | None = None


class Playable(QWidget):
    """Keys that are pressed with the mouse or with Enter, and lit by what sounds.

    Left button: plays while it is down; moved to other keys it plays these (glissando). Moved to other strings of a
    neck it strums: those that it has left ring until the button is up.
    Right button, or Shift: the key is latched (held): it stays down until it is clicked so again.
    Arrows and Enter: choose a key, where the cursor is drawn, and play it; with Ctrl, all strings of a neck.

    Keys are MIDI keys. A spot is down while mouse, latch or Enter press it here. Keys that sound need not be down.
    """

    pressed = Signal(int, int, object)  # key, velocity, string as in `Spot`
    released = Signal(int, object)  # key, string

    def __init__(self, name: str, tip: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName(name)
        self.setToolTip(tip)
        self.setToolTipDuration(TIP_MS)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self._low, self._high = 28, 88  # the lowest and the highest MIDI key that have a string
        self._source = "model"  # that is heard; it gives lit keys their colour
        self._levels: dict[int, int] = {}  # MIDI key -> loudness, 1 … LEVEL_STEPS; silent keys are left out
        self._down: Spot | None = None  # under the left button; None: it is up
        self._at = QPointF()  # of the mouse, while a key is down
        self._clicked = self._played = TYPED  # velocity of the click, which a strum keeps, and of the latest key
        self._strummed: list[Spot] = []  # on strings that the mouse has left
        self.legato = False  # a key that is pressed while another is held takes its note over
        self._typed: list[Spot] = []  # down while Enter is
        self._held: set[Spot] = set()  # latched by the right button or Shift, until clicked so again
        self.chosen = Spot(60)  # the cursor's, which Enter plays
        self._by_keys = False  # the cursor was last reached or moved with the keyboard
        # the velocity of a click at the mouse, or of the one that sounds; "" where no key is
        self.figure, self._figure_at = "", QRectF()
        self.setMouseTracking(True)
        self._rest = QPixmap()  # the picture of `paint_rest`; null: to be painted
        theme.changes.theme_changed.connect(self.rest_changed)

    def sizeHint(self) -> QSize:
        return QSize(720, HEIGHT)

    def minimumSizeHint(self) -> QSize:
        return QSize(480, LOWEST)

    # For subclasses

    @abstractmethod
    def key_at(self, at: QPointF) -> int | None:
        """The key under a point, whether it can sound or not."""

    def spot_at(self, at: QPointF) -> Spot | None:
        """The spot that a click there presses."""
        key = self.key_at(at)
        return None if key is None else Spot(key)

    def spots_between(self, before: QPointF, at: QPointF) -> list[Spot]:
        """The spots on the mouse's way from one point to another, without the first and with the last."""
        spot = self.spot_at(at)
        return [] if spot is None else [spot]

    def stepped(self, arrow: Qt.Key) -> Spot:
        """The spot that an arrow of the keyboard moves the cursor to."""
        return Spot(self.chosen.key + _MOVES[arrow])

    def place_words(self, spot: Spot) -> str:
        return note_name(spot.key)

    def typed(self, all_strings: bool) -> list[Spot]:
        """The spots that Enter plays; `all_strings`: with Ctrl."""
        return [self.chosen]

    @abstractmethod
    def key_rect(self, key: int) -> QRectF:
        """The area that changes when a key sounds."""

    @abstractmethod
    def share_at(self, key: int, at: QPointF) -> float:
        """The share of the way down a key where a point lies, 0 … 1."""

    @abstractmethod
    def paint_rest(self, painter: QPainter) -> None:
        """Paint the surface while nothing sounds and no key is down. Kept as a picture until `rest_changed`."""

    @abstractmethod
    def paint_marks(self, painter: QPainter, dirty: QRectF) -> None:
        """Paint what sounds, what is down, and the cursor, as far as they lie in `dirty`."""

    # What is shown

    def set_range(self, low: int, high: int) -> None:
        """Set the lowest and the highest key that have a string."""
        if (low, high) != (self._low, self._high):
            self.release_all()
            self._low, self._high = low, high
            self._set_cursor(Spot(self.chosen.key))
            self.lay_out()
            self.rest_changed()

    def lay_out(self) -> None:
        """Lay the keys out; called when the range has changed."""

    def rest_changed(self) -> None:
        """Discard the picture of `paint_rest`."""
        self._rest = QPixmap()
        self.update()

    def show_sounding(self, levels: Mapping[int, float]) -> None:
        """Show the loudness of each key, 0 … 1; keys that are left out are silent."""
        steps = {key: round(min(max(level, 0.0), 1.0) * LEVEL_STEPS) for key, level in levels.items()}
        steps = {key: step for key, step in steps.items() if step > 0}
        for key, _ in self._levels.items() ^ steps.items():
            self._repaint(key)
        self._levels = steps

    def show_source(self, source: str) -> None:
        """Show the source that is heard, in whose colour keys are lit."""
        if source != self._source:
            self._source = source
            self.update()

    @property
    def held(self) -> frozenset[int]:
        """The keys that are latched: they stay down until they are clicked so again."""
        return frozenset(spot.key for spot in self._held)

    def release_all(self) -> None:
        self._release_typed()
        self._release_mouse()
        for spot in sorted(self._held):
            self._held.discard(spot)
            self._release(spot)

    def sounds(self, key: int | None) -> bool:
        """Return True if a key has a string."""
        return key is not None and self._low <= key <= self._high

    # For painting

    @property
    def marked(self) -> frozenset[int]:
        """Keys that do not look as at rest: they sound, are down, or have the cursor."""
        cursor = {self.chosen.key} if self.shows_cursor else set()
        return frozenset(self._levels.keys() | cursor | {spot.key for spot in self.down})

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the kept picture of rest, the marks, and the velocity at the mouse."""
        ratio = self.devicePixelRatioF()
        if self._rest.isNull() or self._rest.devicePixelRatio() != ratio:
            self._rest = QPixmap(self.size() * ratio)
            self._rest.setDevicePixelRatio(ratio)
            self._rest.fill(Qt.GlobalColor.transparent)
            with QPainter(self._rest) as painter:
                painter.setRenderHint(QPainter.RenderHint.Antialiasing)
                self.paint_rest(painter)
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.drawPixmap(QPointF(), self._rest)
        self.paint_marks(painter, QRectF(event.rect()))
        if self.figure:
            set_ink(painter, theme.LINE, fill=theme.PANEL)
            painter.drawRoundedRect(self._figure_at.adjusted(1, 1, -1, -1), 3, 3)
            write(painter, self._figure_at, self.figure, theme.TEXT, theme.small_font(10))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.rest_changed()

    def level(self, key: int) -> float:
        """The loudness of a key, 0 … 1."""
        return self._levels.get(key, 0) / LEVEL_STEPS

    def is_down(self, key: int) -> bool:
        return any(spot.key == key for spot in self.down)

    @property
    def down(self) -> frozenset[Spot]:
        """The spots that are down: under the mouse, left by a strum, typed with Enter, or latched."""
        mouse = {self._down} if self._down is not None else set()
        return frozenset(mouse | self._held | {*self._typed, *self._strummed})

    @property
    def colour(self) -> QColor:
        return QColor(theme.SOURCE_COLOURS[theme.source_kind(self._source)])

    # Gestures

    def velocity_at(self, key: int, at: QPointF) -> int:
        """The velocity of a click there: greater further down."""
        return round(SOFTEST + min(max(self.share_at(key, at), 0.0), 1.0) * (HARDEST - SOFTEST))

    def _show_velocity(self, at: QPointF, velocity: int | None) -> None:
        """Show the velocity beside the mouse, where it covers neither the mouse nor what is clicked."""
        before, self.figure = self._figure_at, "" if velocity is None else f"velocity {velocity}"
        metrics = QFontMetricsF(theme.small_font(10))
        width, height = metrics.horizontalAdvance("velocity 127") + 12, metrics.height() + 4
        beside = at.x() + FIGURE_BESIDE
        left = beside if beside + width <= self.width() else at.x() - FIGURE_BESIDE - width
        top = min(max(at.y() - height / 2, 0.0), self.height() - height)
        self._figure_at = QRectF(left, top, width, height) if self.figure else QRectF()
        for place in (before, self._figure_at):
            self.update(place.toAlignedRect())

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Play the spot there while the left button is down; right button or Shift latch it, or end that."""
        spot = self.spot_at(event.position())
        if spot is None or not self.sounds(spot.key) or self._down is not None:
            return
        self._by_keys = False
        self._set_cursor(spot)
        velocity = self.velocity_at(spot.key, event.position())
        if is_second(event):
            if spot in self._held:
                self._held.discard(spot)
                self._release(spot)
            else:
                self._held.add(spot)
                self._press(spot, velocity)
        elif event.button() == Qt.MouseButton.LeftButton:
            self._down = spot
            self._at = event.position()
            self._clicked = velocity
            self._press(spot, velocity)
        self._show_velocity(event.position(), velocity)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        self.mousePressEvent(event)  # fast repeats are notes too

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Play the spots that a drag meets; with no button down, show the velocity that a click would have."""
        if self._down is None:
            key = self.key_at(event.position())
            velocity = self.velocity_at(key, event.position()) if key is not None and self.sounds(key) else None
            self._show_velocity(event.position(), velocity)
            return
        met = self.spots_between(self._at, event.position())
        self._at = event.position()
        for spot in met:
            if spot != self._down and self.sounds(spot.key):
                self._move_to(spot, self.velocity_at(spot.key, self._at))
        self._show_velocity(self._at, self._played)

    def _move_to(self, spot: Spot, velocity: int) -> None:
        """Move the mouse's press to another spot, with a velocity of 1 … 127.

        Without legato, another string is strummed: the one before rings until the button is up. With legato, a key
        of the same string is pressed before the one before is released, so that it takes the note over.
        """
        before, self._down = self._down, spot
        assert before is not None
        for left in [other for other in self._strummed if other.string == spot.string]:
            self._strummed.remove(left)
            self._release_left(left)
        if not self.legato and before.string != spot.string:
            self._strummed.append(before)
            self._press(spot, self._clicked)
        elif self.legato and before.string == spot.string:
            self._press(spot, velocity)
            self._release_left(before)
        else:
            self._release_left(before)
            self._press(spot, velocity)

    def _release_left(self, spot: Spot) -> None:
        """Release a spot that the mouse has left, unless it is latched as well: that ends with the latch.

        Where the key chooses the string (None), every press has a release of its own, latched or not.
        """
        if spot not in self._held or spot.string is None:
            self._release(spot)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton and self._down is not None:
            self._release_mouse()

    def _release_mouse(self) -> None:
        down, self._down = self._down, None
        left, self._strummed = [*self._strummed, *([] if down is None else [down])], []
        for spot in left:
            self._release_left(spot)

    def event(self, event: QEvent) -> bool:
        """Keep Enter, which is a shortcut of the window, while the surface has the focus."""
        return keeps_keys(event, *ENTER_KEYS) or super().event(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Move the cursor by an arrow; play its spot by Enter, with Ctrl all strings; pass other keys on."""
        key = Qt.Key(event.key())
        self._by_keys = self._by_keys or key in _MOVES
        if key in _MOVES:
            self._set_cursor(self.stepped(key))
        elif key in ENTER_KEYS:
            if not event.isAutoRepeat() and not self._typed:
                self._typed = self.typed(bool(event.modifiers() & Qt.KeyboardModifier.ControlModifier))
                for spot in self._typed:
                    self._press(spot, TYPED)
        else:
            super().keyPressEvent(event)

    def keyReleaseEvent(self, event: QKeyEvent) -> None:
        if event.key() in ENTER_KEYS and not event.isAutoRepeat():
            self._release_typed()
        else:
            super().keyReleaseEvent(event)

    def _release_typed(self) -> None:
        typed, self._typed = self._typed, []
        for spot in typed:
            self._release(spot)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        self._release_typed()
        super().focusOutEvent(event)
        self.update()

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self._by_keys = event.reason() in (Qt.FocusReason.TabFocusReason, Qt.FocusReason.BacktabFocusReason)
        self.update()

    def hideEvent(self, event: QHideEvent) -> None:
        self.release_all()
        super().hideEvent(event)

    @property
    def shows_cursor(self) -> bool:
        """Return True if the cursor is drawn: after the keyboard reached or moved it, not the mouse."""
        return self._by_keys and self.hasFocus()

    def _set_cursor(self, spot: Spot) -> None:
        """Move the cursor to a spot, its key limited to those that sound, and describe it to screen readers."""
        spot = spot._replace(key=min(max(spot.key, self._low), self._high))
        before, self.chosen = self.chosen, spot
        self.setAccessibleDescription(
            f"{self.place_words(spot)}; arrows choose a key, Enter plays it at velocity {TYPED}. "
            "Clicks are softer at the top of a key, harder at its bottom"
        )
        self.repaint_spot(before)
        self.repaint_spot(spot)

    def leaveEvent(self, event: QEvent) -> None:
        self._show_velocity(QPointF(), None)
        super().leaveEvent(event)

    def _press(self, spot: Spot, velocity: int) -> None:
        self._played = velocity
        self.repaint_spot(spot)
        self.pressed.emit(spot.key, velocity, spot.string)

    def _release(self, spot: Spot) -> None:
        self.repaint_spot(spot)
        self.released.emit(spot.key, spot.string)

    def repaint_spot(self, spot: Spot) -> None:
        """Repaint a spot; called when it is pressed, released, or the cursor's."""
        self._repaint(spot.key)

    def _repaint(self, key: int) -> None:
        self.update(self.key_rect(key).toAlignedRect().adjusted(-1, -1, 1, 1))


def is_second(event: QMouseEvent) -> bool:
    """Return True if it is the right button, or the left one with Shift."""
    shift = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
    return event.button() == Qt.MouseButton.RightButton or (event.button() == Qt.MouseButton.LeftButton and shift)
