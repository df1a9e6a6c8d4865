"""Keys that play: a filter before the widget that has the keyboard, so that a list or a button does not take them."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QAbstractSpinBox, QApplication, QComboBox, QLineEdit, QPlainTextEdit, QTextEdit, QWidget

from app.playing.keyboard import KeyPress, place_of

_WRITING = (QLineEdit, QAbstractSpinBox, QPlainTextEdit, QTextEdit)
_HELD = (
    Qt.KeyboardModifier.ControlModifier
    | Qt.KeyboardModifier.AltModifier
    | Qt.KeyboardModifier.MetaModifier
    | Qt.KeyboardModifier.ShiftModifier
)


class PlayingKeys(QObject):
    """`pressed` for each letter or digit that nobody writes with. A key that is held down is told once.

    The row of notes comes first, whatever has the keyboard; other keys only if nothing else takes them: a knob takes
    digits.
    """

    pressed = Signal(object)  # a `KeyPress`

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self._watched: QWidget | None = None
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
        if event.type() != QEvent.Type.KeyPress or not isinstance(event, QKeyEvent) or event.modifiers() & _HELD:
            return False
        press = KeyPress(_letter(event), event.nativeScanCode())
        notes = place_of(press) is not None
        if not notes and (watched is not self._window or not press.letter):
            return False
        if not event.isAutoRepeat():
            self.pressed.emit(press)
        event.accept()
        return notes


def _letter(event: QKeyEvent) -> str:
    """What is printed on the key; nothing for keys without a sign."""
    key = event.key()
    return chr(key) if 0x21 <= key < 0x7F else ""


def _writes(widget: QWidget) -> bool:
    return isinstance(widget, _WRITING) or (isinstance(widget, QComboBox) and widget.isEditable())
