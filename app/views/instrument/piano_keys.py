"""A piano keyboard on the screen; how far down on a key one clicks sets the velocity."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QColor, QPainter
from PySide6.QtWidgets import QWidget

from app.shared.key_names import note_name
from app.views import theme
from app.views.instrument.playable import Playable, Spot
from app.views.painting import set_ink, write

BLACK_HEIGHT = 0.62  # of a white key's
BLACK_WIDTH = 0.6  # of the distance of white keys
FEWEST_KEYS = 48  # that are shown, with a string or without
SMALLEST_LETTER, LARGEST_LETTER = 7, 11  # pixels
TIP = (
    "Click or drag to play: softer at the top of a key, harder at the bottom.\n"
    "Right button or Shift: the key stays down. With the keyboard: arrows and Enter"
)
_WHITE_BEFORE = (0, 1, 1, 2, 2, 3, 4, 4, 5, 5, 6, 6)  # white keys of the octave below or left of each key
_BLACK = frozenset((1, 3, 6, 8, 10))


def is_black(key: int) -> bool:
    return key % 12 in _BLACK


def shown_range(low: int, high: int) -> tuple[int, int]:
    """The first and the last key of whole octaves, C to B, about a range; four octaves at least."""
    first, last = low - low % 12, high + 11 - high % 12
    while last - first + 1 < FEWEST_KEYS:
        if first >= 12 and (low - first <= last - high or last > 115):
            first -= 12
        else:
            last += 12
    return first, last


class PianoKeys(Playable):
    """Piano keys in whole octaves; those without a string are grey."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("On-screen keyboard", TIP, parent)
        self._letters: dict[int, str] = {}  # MIDI key -> what is printed on the computer's key that plays it
        self._first, self._last = shown_range(self._low, self._high)  # MIDI keys that are shown
        self._set_cursor(Spot(60))

    def show_letters(self, letters: Mapping[int, str]) -> None:
        """Show the characters printed on the computer's keys, by the MIDI key that each plays."""
        if dict(letters) != self._letters:
            self._letters = dict(letters)
            self.rest_changed()

    def lay_out(self) -> None:
        self._first, self._last = shown_range(self._low, self._high)

    # Where keys are

    def _white_keys_before(self, key: int) -> int:
        return 7 * ((key - self._first) // 12) + _WHITE_BEFORE[key % 12]

    @property
    def _pitch(self) -> float:
        """The distance of white keys, in pixels."""
        return self.width() / (self._white_keys_before(self._last) + 1)

    @property
    def _letter_size(self) -> int:
        """The size of letters in pixels: as large as a black key is wide."""
        return min(max(round(0.9 * BLACK_WIDTH * self._pitch), SMALLEST_LETTER), theme.px(LARGEST_LETTER))

    def key_rect(self, key: int) -> QRectF:
        """The box of a key in pixels, of a white one with what black ones cover; empty for one that is not shown."""
        if not self._first <= key <= self._last:
            return QRectF()
        left = self._white_keys_before(key) * self._pitch
        if not is_black(key):
            return QRectF(left, 0, self._pitch, self.height())
        width = BLACK_WIDTH * self._pitch
        return QRectF(left - width / 2, 0, width, BLACK_HEIGHT * self.height())

    def key_at(self, at: QPointF) -> int | None:
        """The black key at a point, else the white one; None outside the keyboard."""
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

    def paint_rest(self, painter: QPainter) -> None:
        painter.fillRect(self.rect(), QColor(theme.LINE))  # between the keys
        for key in sorted(range(self._first, self._last + 1), key=is_black):  # black ones lie above
            self._paint_key(painter, key, QColor(_own(key)) if self.sounds(key) else _silent_colour(key))

    def paint_marks(self, painter: QPainter, dirty: QRectF) -> None:
        """Paint marked keys, and the black ones that lie over marked white ones; latched keys have a dot."""
        marked = self.marked
        covering = {black for key in marked for black in (key - 1, key + 1) if is_black(black) and not is_black(key)}
        for key in sorted(marked | covering, key=is_black):
            rect, filling = self.key_rect(key), self._fill_colour(key)
            if not rect.intersects(dirty):
                continue
            self._paint_key(painter, key, filling)
            if key in self.held:  # by itself: it has a dot
                set_ink(painter, fill=_ink(filling))
                dot = QPointF(rect.center().x(), rect.bottom() - (26 if is_black(key) else 38))
                painter.drawEllipse(dot, 2.5, 2.5)
        if self.shows_cursor:
            key = self.chosen.key
            set_ink(painter, _ink(self._fill_colour(key)), 1.5)
            painter.drawRoundedRect(self.key_rect(key).adjusted(3, 2, -3, -4), 3, 3)

    def _fill_colour(self, key: int) -> QColor:
        if not self.sounds(key):
            return _silent_colour(key)
        level, key_colour = self.level(key), _own(key)
        if level > 0:
            return theme.blended(self.colour.name(), key_colour, 0.35 + 0.65 * level)
        return theme.blended(theme.FAINT, key_colour, 0.45) if self.is_down(key) else QColor(key_colour)

    def _paint_key(self, painter: QPainter, key: int, filling: QColor) -> None:
        """Paint a key in a colour, with the name of each C and the letter of the computer's key on it."""
        rect = self.key_rect(key)
        if is_black(key):
            set_ink(painter, theme.LINE, fill=filling)
            painter.drawRoundedRect(rect.adjusted(0, -4, 0, 0), 2.5, 2.5)
        else:
            set_ink(painter, fill=filling)
            painter.drawRoundedRect(rect.adjusted(0.5, -4, -0.5, -1), 3, 3)
        letter = self._letters.get(key, "") if self.sounds(key) else ""
        words = (note_name(key) if key % 12 == 0 else "", 16, theme.px(9))
        for word, above, size in (words, (letter, 18 if is_black(key) else 30, self._letter_size)):
            if word:  # so many pixels above the key's lower edge
                place = QRectF(rect.left() - 4, rect.bottom() - theme.px(above), rect.width() + 8, theme.px(13))
                write(painter, place, word, _ink(filling), theme.small_font(size, bold=above > 16, grows=False))


def _own(key: int) -> str:
    """The colour of a key at rest: white keys are light under both themes, and black ones dark."""
    pick = min if is_black(key) else max
    return pick(theme.TEXT, theme.RAISED, theme.BACKGROUND, key=lambda colour: QColor(colour).lightness())


def _silent_colour(key: int) -> QColor:
    return theme.blended(_own(key), theme.LINE, 0.3)


def _ink(filling: QColor) -> str:
    return max(theme.TEXT, theme.BACKGROUND, key=lambda ink: theme.contrast(ink, filling.name()))
