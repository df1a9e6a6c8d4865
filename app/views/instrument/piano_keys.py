"""A piano's keyboard on the screen: where on a key one clicks is how hard it is struck."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QResizeEvent
from PySide6.QtWidgets import QWidget

from app.views import theme
from app.views.instrument.playable import Playable, note_name

BLACK_HEIGHT = 0.62  # of a white key's
BLACK_WIDTH = 0.6
FEWEST_KEYS = 49
TIP = (
    "Click or drag to play: softer at the top of a key, harder at the bottom.\n"
    "Right button or Shift: the key stays down. With the keyboard: arrows and Enter"
)
_WHITE_BEFORE = (0, 1, 1, 2, 2, 3, 4, 4, 5, 5, 6, 6)  # white keys of the octave below or left of each key
_BLACK = frozenset((1, 3, 6, 8, 10))


def is_black(key: int) -> bool:
    return key % 12 in _BLACK


def shown_range(low: int, high: int) -> tuple[int, int]:
    """Whole octaves from C to B about a range, and four of them at least."""
    first, last = low - low % 12, high + 11 - high % 12
    while last - first + 1 < FEWEST_KEYS - 1:
        if first >= 12 and (low - first <= last - high or last > 115):
            first -= 12
        else:
            last += 12
    return first, last


class PianoKeys(Playable):
    """Shows whole octaves; keys without a string are grey."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("On-screen keyboard", TIP, parent)
        self._letters: dict[int, str] = {}
        self._first, self._last = shown_range(self._low, self._high)
        self._set_cursor(60)

    def show_letters(self, letters: Mapping[int, str]) -> None:
        """The computer's keys that play, by the key that each plays."""
        if dict(letters) != self._letters:
            self._letters = dict(letters)
            self.update()

    def lay_out(self) -> None:
        self._first, self._last = shown_range(self._low, self._high)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.update()

    # Where keys are

    def _white(self, key: int) -> int:
        """How many white keys lie left of it."""
        return 7 * ((key - self._first) // 12) + _WHITE_BEFORE[key % 12]

    @property
    def _pitch(self) -> float:
        """From a white key to the next, in pixels."""
        return self.width() / (self._white(self._last) + 1)

    def key_rect(self, key: int) -> QRectF:
        if not self._first <= key <= self._last:
            return QRectF()
        left = self._white(key) * self._pitch
        if not is_black(key):
            return QRectF(left, 0, self._pitch, self.height())
        width = BLACK_WIDTH * self._pitch
        return QRectF(left - width / 2, 0, width, BLACK_HEIGHT * self.height())

    def key_at(self, at: QPointF) -> int | None:
        if not (0 <= at.x() < self.width() and 0 <= at.y() < self.height()):
            return None
        white = int(at.x() / self._pitch)
        octave, place = divmod(white, 7)
        key = self._first + 12 * octave + (0, 2, 4, 5, 7, 9, 11)[place]
        for black in (key - 1, key + 1):
            if is_black(black) and self.key_rect(black).contains(at):
                return black
        return key

    def share_at(self, key: int, at: QPointF) -> float:
        return at.y() / self.key_rect(key).height()

    # How they look

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillRect(event.rect(), QColor(theme.LINE))  # between the keys
        dirty = QRectF(event.rect())
        keys = [key for key in range(self._first, self._last + 1) if self.key_rect(key).intersects(dirty)]
        for key in sorted(keys, key=is_black):  # black ones lie above
            self._paint_key(painter, key)

    def _paint_key(self, painter: QPainter, key: int) -> None:
        rect, own, ink = self.key_rect(key), _ivory(), _ebony()
        if is_black(key):
            own, ink = ink, own
        filling = self._filling(key, own)
        if theme.contrast(filling.name(), ink) < theme.contrast(filling.name(), own):
            ink = own
        painter.setBrush(filling)
        if is_black(key):
            painter.setPen(QPen(QColor(theme.LINE), 1))
            painter.drawRoundedRect(rect.adjusted(0, -4, 0, 0), 2.5, 2.5)
        else:
            painter.setPen(Qt.PenStyle.NoPen)
            painter.drawRoundedRect(rect.adjusted(0.5, -4, -0.5, -1), 3, 3)
        painter.setPen(QColor(ink))
        if key % 12 == 0:
            self._paint_word(painter, rect, note_name(key), 16, 9)
        if self.sounds(key):
            self._paint_word(painter, rect, self._letters.get(key, ""), 18 if is_black(key) else 30, 11)
        if self.hasFocus() and key == self.cursor_key:
            painter.setPen(QPen(QColor(ink), 1.5))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawRoundedRect(rect.adjusted(3, 2, -3, -4), 3, 3)

    def _filling(self, key: int, own: str) -> QColor:
        if not self.sounds(key):
            return theme.blended(own, theme.LINE, 0.3)
        ground = theme.blended(theme.FAINT, own, 0.45).name() if self.is_down(key) else own
        level = self.level(key)
        return theme.blended(self.colour.name(), ground, 0.25 + 0.75 * level) if level > 0 else QColor(ground)

    def _paint_word(self, painter: QPainter, key: QRectF, word: str, above: int, size: int) -> None:
        """`above` the foot of a key, in pixels."""
        painter.setFont(theme.small_font(size, bold=size > 9))
        place = QRectF(key.left() - 4, key.bottom() - above, key.width() + 8, 13)
        painter.drawText(place, Qt.AlignmentFlag.AlignCenter, word)


def _ivory() -> str:
    """The lighter of text and raised ground: white keys are light under both faces."""
    return max(theme.TEXT, theme.RAISED, key=lambda colour: QColor(colour).lightness())


def _ebony() -> str:
    return min(theme.TEXT, theme.BACKGROUND, key=lambda colour: QColor(colour).lightness())
