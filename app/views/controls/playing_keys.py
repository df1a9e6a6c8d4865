"""Keys that play: a filter before the widget that has the keyboard, so that a list or a button does not take them."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QAbstractSpinBox, QApplication, QComboBox, QLineEdit, QPlainTextEdit, QTextEdit, QWidget

from app.playing.keyboard import KeyPress, place_of, semitone_of

_WRITING = (QLineEdit, QAbstractSpinBox, QPlainTextEdit, QTextEdit)
_HELD = (
    Qt.KeyboardModifier.ControlModifier
    | Qt.KeyboardModifier.AltModifier
    | Qt.KeyboardModifier.MetaModifier
    | Qt.KeyboardModifier.ShiftModifier
)


class PlayingKeys(QObject):
    """`pressed` for each letter or digit that nobody writes with. A key that is held down is told once.

    Keys that are notes come first, whatever has the keyboard; other keys only if nothing else takes them: a knob
    takes digits. `released` is for keys that were told, also where the window loses the keyboard.

    Attributes:
        piano: whether notes are those of a piano's two rows, or the row of places.
    """

    pressed = Signal(object)  # a `KeyPress`
    released = Signal(object)

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self._watched: QWidget | None = None
        self.piano = False
        self._down: dict[int, KeyPress] = {}  # by Qt's key, or the platform's code
        window.installEventFilter(self)
        application = QApplication.instance()
        assert isinstance(application, QApplication)
        application.focusChanged.connect(self._watch)

    def _watch(self, _: QWidget | None, now: QWidget | None) -> None:
        """Looks at the keys of the widget that has the keyboard, and of no other: every event passes through here."""
        if self._watched is not None:
            self._watched.removeEventFilter(self)
        self._watched = None
        if now is not None and now is not self._window and now.window() is self._window and not _writes(now):
            self._watched = now
            now.installEventFilter(self)
            now.destroyed.connect(self._forget)

    def _forget(self) -> None:
        self._watched = None

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.WindowDeactivate:
            for press in (*self._down.values(),):
                self.released.emit(press)
            self._down.clear()
            return False
        if not isinstance(event, QKeyEvent):
            return False
        if event.type() == QEvent.Type.KeyRelease and not event.isAutoRepeat():
            return self._release(event)
        if event.type() != QEvent.Type.KeyPress or event.modifiers() & _HELD:
            return False
        press = KeyPress(_letter(event), event.nativeScanCode())
        notes = (semitone_of(press) if self.piano else place_of(press)) is not None
        if not notes and (watched is not self._window or not press.letter):
            return False
        if not event.isAutoRepeat():
            self._down[_number(event)] = press
            self.pressed.emit(press)
        event.accept()
        return notes

    def _release(self, event: QKeyEvent) -> bool:
        press = self._down.pop(_number(event), None)
        if press is None:
            return False
        self.released.emit(press)
        return (semitone_of(press) if self.piano else place_of(press)) is not None


def _number(event: QKeyEvent) -> int:
    return event.nativeScanCode() or -event.key()


def _letter(event: QKeyEvent) -> str:
    """What is printed on the key; nothing for keys without a sign."""
    key = event.key()
    return chr(key) if 0x21 <= key < 0x7F else ""


def _writes(widget: QWidget) -> bool:
    return isinstance(widget, _WRITING) or (isinstance(widget, QComboBox) and widget.isEditable())
