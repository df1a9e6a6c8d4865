"""The strings of an instrument: a neck with frets, or a fan of many strings. What sounds is lit where it is stopped.

A few strings are rows, the highest on top, with fret n at 1 - 2^(-n/12) of the length from the nut. Many strings, or
one that is shortened for every key, stand side by side, each as long as its key leaves it. The square root of the
length is drawn, or the highest would be too short to see.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent, QMouseEvent, QPainter, QPainterPath, QPen
from PySide6.QtWidgets import QWidget

from app.shared.key_names import note_name
from app.views import theme
from app.views.controls.parts import ENTER_KEYS
from app.views.instrument.playable import LEVEL_STEPS, Playable, Spot, is_second
from app.views.painting import set_ink, write

if TYPE_CHECKING:
    from app.playing.keys import SoundingNote

MOST_ROWS, MOST_FRETS = 8, 24
_NAMES_WIDTH = 40  # open strings, left of the nut
_FOOT = 15  # numbers of frets, names of octaves
SHORTEST = 0.14  # least length of a string, as a share of the fan's height
THICK, THIN = 2.6, 1.0  # lowest and highest string, in pixels
LARGEST_DOT = 14.0
PLACES = 8  # steps from one fret to the next, at which a sliding string is drawn
_ARROWS = {  # frets along the string, strings
    Qt.Key.Key_Right: (1, 0),
    Qt.Key.Key_Left: (-1, 0),
    Qt.Key.Key_Up: (0, 1),
    Qt.Key.Key_Down: (0, -1),
}
SWING = 0.42  # how far a string at full level is drawn to either side, of its row's height
INLAYS = (3, 5, 7, 9, 12, 15, 17, 19, 21, 24)
TIP = (
    "Click or drag to play: softer at the upper edge of a string's row, harder at the lower.\n"
    "Drag across strings to strum; across their names, open strings. They ring while the button is down.\n"
    "Right button or Shift: put a finger on a string, or lift it; clicks and drags then play the strings\n"
    "as the fingers stop them. Delete lifts all fingers.\n"
    "With the keyboard: arrows and Enter; Shift+Enter for a finger, Ctrl+Enter for all strings"
)


def fret_share(fret: float, frets: int) -> float:
    """The place of a fret between the nut, 0, and the last of `frets`, 1."""
    return (1 - 2 ** (-fret / 12)) / (1 - 2 ** (-frets / 12))


class Neck(Playable):
    """A neck, or a fan of strings.

    A click plays the string that was clicked. Keys of others play the highest string at or below them.

    Fingers stay where they were put, and make no sound. While there are any, strings sound as these stop them, and
    those without a finger sound open, wherever they are clicked. So chords can be strummed with one mouse.

    Here strings count from the lowest, 0, as rows from below; `Spot.string` counts from the highest. A level is a
    loudness.
    """

    fingered = Signal(bool)  # whether there are fingers

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Strings", TIP, parent)
        self._strings: tuple[tuple[str, int], ...] = ()  # name and open MIDI key of each, from the lowest
        self._stops: dict[tuple[int, float], int] = {}  # string, fret where it sounds -> level, 1 … LEVEL_STEPS
        self.fingers: dict[int, int] = {}  # string, counted from the lowest -> the fret where a finger stops it
        self._set_cursor(Spot(60))

    def show_notes(self, notes: Iterable[SoundingNote]) -> None:
        """Light the strings of a neck at the frets where the notes stop them; a slide lies between two frets."""
        strings: dict[tuple[int, float], int] = {}
        for note in notes if self.in_rows else ():
            string = len(self._strings) - 1 - note.string
            if not 0 <= note.string < len(self._strings):
                string = self.string_of(note.key)
            fret = round(PLACES * (note.key + note.slid - self._strings[string][1])) / PLACES
            fret = min(max(fret, 0.0), float(self.frets))
            step = round(min(max(note.level, 0.0), 1.0) * LEVEL_STEPS)
            if step > 0:
                strings[string, fret] = max(step, strings.get((string, fret), 0))
        for (string, _), _ in self._stops.items() ^ strings.items():
            self._repaint_row(string)
        self._stops = strings

    def set_strings(self, strings: Sequence[tuple[str, int]]) -> None:
        """Set the strings, (name, open MIDI key) each; a neck for 2 … MOST_ROWS of them, otherwise a fan."""
        ordered = tuple(sorted(strings, key=lambda string: string[1]))
        if ordered != self._strings:
            self.release_all()
            self._strings, self._stops = ordered, {}
            self.lift()
            self._set_cursor(Spot(self.chosen.key))
            self.rest_changed()

    @property
    def in_rows(self) -> bool:
        """Return True if it is a neck, not a fan."""
        return 1 < len(self._strings) <= MOST_ROWS

    # Where keys are

    @property
    def _bottom(self) -> int:
        """The lower edge of the strings, above numbers of frets and names of octaves."""
        return self.height() - theme.px(_FOOT)

    @property
    def _nut(self) -> int:
        """The x of the nut, right of the names of open strings."""
        return theme.px(_NAMES_WIDTH)

    @property
    def frets(self) -> int:
        """The number of frets: to the highest key, and two octaves at most."""
        highest = self._strings[-1][1] if self._strings else self._low
        return min(max(self._high - highest, 12), MOST_FRETS)

    def string_of(self, key: int) -> int:
        """The string that sounds a key, counted from the lowest."""
        below = [number for number, (_, open_key) in enumerate(self._strings) if open_key <= key]
        return below[-1] if below else 0

    def fret_x(self, fret: float) -> float:
        return self._nut + fret_share(fret, self.frets) * (self.width() - self._nut - 6)

    def cell(self, string: int, fret: int) -> QRectF:
        """The cell where a finger stops the string: from the fret before to this one.

        Fret 0: the name of the open string.
        """
        height = self._bottom / len(self._strings)
        top = (len(self._strings) - 1 - string) * height
        left = 0.0 if fret <= 0 else self.fret_x(fret - 1)
        return QRectF(left, top, self.fret_x(max(fret, 0)) - left, height)

    def key_rect(self, key: int) -> QRectF:
        if not self.in_rows:
            return self._column(key).adjusted(-4, 0, 4, 0)
        string = self.string_of(key)
        cell = self.cell(string, min(key - self._strings[string][1], self.frets)).adjusted(-10, -5, 0, 5)
        cell.setRight(self.width())  # the string is lit from there on
        return cell

    def _column(self, key: int) -> QRectF:
        width = self.width() / (self._high - self._low + 1)
        return QRectF((key - self._low) * width, 0, width, self.height())

    def key_at(self, at: QPointF) -> int | None:
        """The key at a point, of a fan's column or a neck's fret; None outside, as behind the last fret."""
        if not (0 <= at.x() < self.width() and 0 <= at.y() < self.height()):
            return None
        if not self.in_rows:
            return self._low + int(at.x() / self.width() * (self._high - self._low + 1))
        string = self._row_at(at)
        fret = next((n for n in range(self.frets + 1) if at.x() < self.fret_x(n)), None)
        return None if fret is None or at.y() >= self._bottom else self._strings[string][1] + fret

    def spot_at(self, at: QPointF) -> Spot | None:
        key = self.key_at(at)
        if key is None or not self.in_rows:
            return super().spot_at(at)
        return self._stopped(self._row_at(at), key)

    def _stopped(self, string: int, key: int) -> Spot:
        """A key on a string, counted from the lowest; if there are fingers, the key where these stop it."""
        if self.fingers:
            key = self._strings[string][1] + self.fingers.get(string, 0)
        return Spot(key, len(self._strings) - 1 - string)

    def _row_of(self, spot: Spot) -> int:
        """The string that a spot is on, counted from the lowest."""
        return self.string_of(spot.key) if spot.string is None else len(self._strings) - 1 - spot.string

    def _fret_of(self, spot: Spot) -> int:
        return min(max(spot.key - self._strings[self._row_of(spot)][1], 0), self.frets)

    def stepped(self, arrow: Qt.Key) -> Spot:
        """The next spot; on a neck a fret along the string, or the same fret of the next string."""
        if not self.in_rows:
            return super().stepped(arrow)
        along, across = _ARROWS[arrow]
        string = min(max(self._row_of(self.chosen) + across, 0), len(self._strings) - 1)
        fret = min(max(self._fret_of(self.chosen) + along, 0), self.frets)
        return Spot(self._strings[string][1] + fret, len(self._strings) - 1 - string)

    def place_words(self, spot: Spot) -> str:
        """The words of a spot, with the string and the fret where it is a neck."""
        if not self.in_rows:
            return super().place_words(spot)
        string, fret = self._strings[self._row_of(spot)][0], self._fret_of(spot)
        return f"{note_name(spot.key)}, string {string}, {f'fret {fret}' if fret else 'open'}"

    def typed(self, all_strings: bool) -> list[Spot]:
        if not self.in_rows:
            return super().typed(all_strings)
        rows = range(len(self._strings)) if all_strings else [self._row_of(self.chosen)]
        spots = [self._stopped(row, self._strings[row][1] + self._fret_of(self.chosen)) for row in rows]
        return [spot for spot in spots if self.sounds(spot.key)]

    def _row_at(self, at: QPointF) -> int:
        height = self._bottom / len(self._strings)
        return min(max(len(self._strings) - 1 - int(at.y() / height), 0), len(self._strings) - 1)

    def spots_between(self, before: QPointF, at: QPointF) -> list[Spot]:
        """The spots from one place of the mouse to the next; on a neck also of the strings that lie between them."""
        met = super().spots_between(before, at)
        if not self.in_rows:
            return met
        first, last = self._row_at(before), self._row_at(at)
        step = 1 if last > first else -1
        crossed = []
        for string in range(first + step, last, step):
            y = self.cell(string, 0).center().y()
            x = before.x() + (at.x() - before.x()) * (y - before.y()) / (at.y() - before.y())
            crossed.append(self.spot_at(QPointF(x, y)))
        return [spot for spot in crossed if spot is not None] + met

    def share_at(self, key: int, at: QPointF) -> float:
        if not self.in_rows:
            return at.y() / self._bottom
        rect = self.cell(self._row_at(at), 0)
        return (at.y() - rect.top()) / rect.height()

    # Fingers

    def mousePressEvent(self, event: QMouseEvent) -> None:
        key = self.key_at(event.position())
        if not (self.in_rows and is_second(event)):
            super().mousePressEvent(event)
        elif key is not None and self.sounds(key):
            string = self._row_at(event.position())
            self._put_finger(string, key - self._strings[string][1])

    def _put_finger(self, string: int, fret: int) -> None:
        """Put a finger on a string; lift it where it is already, or at the nut."""
        if fret <= 0 or self.fingers.get(string) == fret:
            self.fingers.pop(string, None)
        else:
            self.fingers[string] = fret
        self.fingered.emit(bool(self.fingers))
        self.update()

    def lift(self) -> None:
        self.fingers = {}
        self.fingered.emit(False)
        self.update()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Put or lift a finger at the cursor by Shift+Enter; lift all by Delete; other keys as of `Playable`."""
        shift = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
        if self.in_rows and shift and event.key() in ENTER_KEYS:
            if not event.isAutoRepeat():
                self._put_finger(self._row_of(self.chosen), self._fret_of(self.chosen))
        elif self.fingers and event.key() in (Qt.Key.Key_Delete, Qt.Key.Key_Backspace):
            self.lift()
        else:
            super().keyPressEvent(event)

    # How it looks

    def paint_rest(self, painter: QPainter) -> None:
        """Paint the board with its strings; or a fan, where keys that have an open string are brighter."""
        if self.in_rows:
            self._paint_board(painter)
            for number in range(len(self._strings)):
                self._paint_string(painter, number)
            return
        open_keys = {open_key for _, open_key in self._strings}
        for key in range(self._low, self._high + 1):
            self._paint_column(painter, key, QColor(theme.TEXT if key in open_keys else theme.FAINT), 0.0)
            if key % 12 == 0:
                x, foot = self._column(key).center().x(), theme.px(_FOOT)
                place = QRectF(x - 16, self.height() - foot, 32, foot - 1)
                write(painter, place, note_name(key), theme.FAINT, theme.small_font(9))

    def paint_marks(self, painter: QPainter, dirty: QRectF) -> None:
        """Paint fingers and stops of a neck, or lit strings of a fan; above them the cursor."""
        if self.in_rows:
            self._paint_stops(painter)
        for key in () if self.in_rows else sorted(self.marked):
            level = self.level(key)
            lit = theme.blended(self.colour.name(), theme.PANEL, 0.3 + 0.7 * level)
            if not self.key_rect(key).intersects(dirty) or not (level > 0 or self.is_down(key)):
                continue
            if self.sounds(key):
                end = self._paint_column(painter, key, lit if level > 0 else QColor(theme.FAINT), 1.0)
                set_ink(painter, fill=self.colour if level > 0 else theme.FAINT)
                painter.drawEllipse(end, *(2 * [2.5 + 2.5 * level]))
        if self.shows_cursor:
            set_ink(painter, theme.TEXT, 1.5)
            if self.in_rows:
                place = self.cell(self._row_of(self.chosen), self._fret_of(self.chosen))
            else:
                place = self._column(self.chosen.key).adjusted(0, 0, 0, -theme.px(_FOOT))
            painter.drawRoundedRect(place.adjusted(1, 1, -1, -1), 3, 3)

    def _paint_board(self, painter: QPainter) -> None:
        """Paint the fingerboard: frets, inlays with the numbers of their frets below, and the nut."""
        bottom = self._bottom
        board = QRectF(self._nut, 1, self.fret_x(self.frets) - self._nut, bottom - 2)
        set_ink(painter, theme.LINE, fill=theme.RAISED)
        painter.drawRoundedRect(board, 3, 3)
        for fret in range(1, self.frets + 1):
            x, before = self.fret_x(fret), self.fret_x(fret - 1)
            painter.setPen(QPen(QColor(theme.LINE), 1.5))
            painter.drawLine(QPointF(x, 2), QPointF(x, bottom - 2))
            if fret not in INLAYS:
                continue
            set_ink(painter, fill=theme.blended(theme.FAINT, theme.RAISED, 0.6))
            rows = len(self._strings)
            between = max(1, rows // 3) / rows  # the edge to each of the two inlays of an octave, as a share
            for share in (between, 1 - between) if fret % 12 == 0 else (0.5,):
                painter.drawEllipse(QPointF((x + before) / 2, share * bottom), 4.5, 4.5)
            number = QRectF(before - 10, bottom + 1, x - before + 20, theme.px(_FOOT) - 2)
            write(painter, number, str(fret), theme.FAINT, theme.small_font(9))
        painter.setPen(QPen(QColor(theme.FAINT), 4))
        painter.drawLine(QPointF(self._nut, 2), QPointF(self._nut, bottom - 2))

    def _paint_string(self, painter: QPainter, number: int) -> None:
        """Paint a string at rest, counted from the lowest, and its name left of the nut."""
        name, open_key = self._strings[number]
        row = self.cell(number, 0)
        room = self._nut - 10
        place, ink = QRectF(0, row.top(), room, row.height()), theme.TEXT if self.sounds(open_key) else theme.DISABLED
        write(painter, place, name, ink, theme.small_font(11, bold=True), room=room)
        thick = THICK - (THICK - THIN) * number / max(1, len(self._strings) - 1)
        painter.setPen(QPen(QColor(theme.FAINT), thick))
        y = row.center().y()
        painter.drawLine(QPointF(self._nut, y), QPointF(self.fret_x(self.frets), y))

    def _paint_stops(self, painter: QPainter) -> None:
        """Fingers and what is down; above them, strings that sound, where they are stopped now."""
        set_ink(painter, theme.TEXT, 1.5, theme.RAISED)
        for string, stop in self.fingers.items():
            middle = QPointF(self._stop_x(stop, self._dot), self.cell(string, 0).center().y())
            painter.drawEllipse(middle, *(2 * [self._dot / 2]))
        for spot in self.down:
            if not self.level(spot.key) > 0:
                string = self._row_of(spot)
                self._paint_stopped(painter, string, spot.key - self._strings[string][1], 0.0)
        for (string, fret), step in sorted(self._stops.items()):
            self._paint_stopped(painter, string, fret, step / LEVEL_STEPS)

    def _stop_x(self, fret: float, size: float) -> float:
        """The x where the dot of a fret is drawn: before the fret, and between two of them in proportion."""
        whole = int(fret)
        if fret > whole:
            left, right = self._stop_x(whole, size), self._stop_x(whole + 1, size)
            return left + (fret - whole) * (right - left)
        if whole <= 0:
            return self._nut
        return self.fret_x(whole) - min(size, (self.fret_x(whole) - self.fret_x(whole - 1)) / 2)

    def repaint_spot(self, spot: Spot) -> None:
        super().repaint_spot(spot)
        if self.in_rows:
            self._repaint_row(self._row_of(spot))

    def _repaint_row(self, string: int) -> None:
        self.update(self.cell(string, 0).adjusted(0, -6, self.width(), 6).toAlignedRect())

    @property
    def _dot(self) -> float:
        return min(LARGEST_DOT, self._bottom / len(self._strings) - 2)

    def _paint_stopped(self, painter: QPainter, string: int, fret: float, level: float) -> None:
        """Paint the dot where a string is stopped; at a level above 0, up to 1, also how it sounds from there on."""
        size = self._dot
        fret = min(max(fret, 0), self.frets)
        lit = theme.blended(self.colour.name(), theme.RAISED, 0.3 + 0.7 * level)
        middle = QPointF(self._stop_x(fret, size), self.cell(string, 0).center().y())
        if level > 0:
            painter.setPen(QPen(lit, 2))
            painter.drawLine(middle, QPointF(self.fret_x(self.frets), middle.y()))
            self._paint_swing(painter, middle, level)
            set_ink(painter, fill=theme.translucent(self.colour.name(), 70))
            painter.drawEllipse(middle, *(2 * [size / 2 + 4 * level]))
        set_ink(painter, theme.RAISED, fill=self.colour if level > 0 else theme.FAINT)
        painter.drawEllipse(middle, *(2 * [size / 2 * (0.6 + 0.4 * level)]))

    def _paint_swing(self, painter: QPainter, stop: QPointF, level: float) -> None:
        """Paint the swing of a string, from where it is stopped to the bridge."""
        far, reach = self.fret_x(self.frets), SWING * level * self._bottom / len(self._strings)
        swing = QPainterPath(stop)
        for side in (-1, 1):
            swing.quadTo((stop.x() + far) / 2, stop.y() + 2 * side * reach, far if side < 0 else stop.x(), stop.y())
        set_ink(painter, fill=theme.translucent(self.colour.name(), 90))
        painter.drawPath(swing)

    def _paint_column(self, painter: QPainter, key: int, ink: QColor, thicker: float) -> QPointF:
        """Paint a key's string in the fan, `thicker` than at rest by so many pixels; return its lower end."""
        length = max(SHORTEST, 2 ** (-(key - self._low) / 24)) * (self._bottom - 8)
        x = self._column(key).center().x()
        thick = THICK - (THICK - THIN) * (key - self._low) / max(1, self._high - self._low)
        painter.setPen(QPen(ink, thick + thicker))
        end = QPointF(x, 3 + length)
        painter.drawLine(QPointF(x, 3), end)
        return end
