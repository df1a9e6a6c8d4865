"""The computer's keys that play: a filter on the focused widget, so that lists and buttons do not take them."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QAbstractSpinBox, QApplication, QComboBox, QLineEdit, QPlainTextEdit, QTextEdit, QWidget

from app.playing.keyboard import KeyPress, place_of, semitone_of
from app.views.controls.browser import open_browser

X11 = "xcb"  # Qt's name: there a held key is repeated by releases and presses, most of which Qt does not mark so
LEAVE_MS = 2  # delay of `released` there: by then the press of a repetition has arrived
REPEAT_MS = 5  # at most, from such a release to the press of the repetition, on the clock of the X server
_WRITING = (QLineEdit, QAbstractSpinBox, QPlainTextEdit, QTextEdit)
_HELD = (  # modifiers with which a key does not play
    Qt.KeyboardModifier.ControlModifier
    | Qt.KeyboardModifier.AltModifier
    | Qt.KeyboardModifier.MetaModifier
    | Qt.KeyboardModifier.ShiftModifier
)


class PlayingKeys(QObject):
    """The keys of the computer: `pressed` for letters and digits, once while a key is held; not in text fields.

    While a browser is open, keys that write go to its search instead.

    Keys that are notes are taken before the focused widget gets them; other keys only where it does not take them (a
    knob takes digits). Each `pressed` is followed by a `released`, at the latest when the window loses the focus.

    Args:
        platform: Qt's name of it; default the present one.

    Attributes:
        piano: whether notes are the two rows of a piano, or one row of ten places.
    """

    pressed = Signal(object)  # a `KeyPress`
    released = Signal(object)

    def __init__(self, window: QWidget, platform: str = "") -> None:
        super().__init__(window)
        self._holds_back = (platform or QApplication.platformName()) == X11  # releases wait LEAVE_MS
        self._window = window
        self._watched: QWidget | None = None  # has the keyboard focus and is filtered; None: the window alone is
        self.piano = False
        self._down: dict[int, KeyPress] = {}  # keys that were reported as pressed, by `_number`
        self._leaving: dict[int, int] = {}  # keys whose release is held back -> when, in ms of the platform's clock
        window.installEventFilter(self)
        application = QApplication.instance()
        assert isinstance(application, QApplication)
        application.focusChanged.connect(self._watch)

    def _watch(self, _: QWidget | None, now: QWidget | None) -> None:
        """Filter the focused widget alone: every event of a filtered one comes here, which costs time."""
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
        """Take keys that play; return True for those, so that no other widget gets them."""
        if event.type() == QEvent.Type.WindowDeactivate:
            self._let_go(*self._down)
            return False
        if not isinstance(event, QKeyEvent):
            return False
        if event.type() == QEvent.Type.KeyRelease and not event.isAutoRepeat():
            return self._release(event)
        if (browser := open_browser(self._window)) is not None:
            return event.type() != QEvent.Type.KeyRelease and browser.take_typed(event)
        if event.type() != QEvent.Type.KeyPress or event.modifiers() & _HELD:
            return False
        press = KeyPress(_letter(event), event.nativeScanCode())
        notes = (semitone_of(press) if self.piano else place_of(press)) is not None
        if not notes and (watched is not self._window or not press.letter):
            return False
        number = _number(event)
        repeats = number in self._leaving and event.timestamp() - self._leaving[number] <= REPEAT_MS
        if repeats and event.nativeScanCode():
            del self._leaving[number]  # a repetition, which Qt does not mark as one while it is busy
            event.accept()
            return notes
        if not event.isAutoRepeat():
            self._let_go(number, *self._leaving)  # the release of this one may have been lost
            self._down[number] = press
            self.pressed.emit(press)
        event.accept()
        return notes

    def _let_go(self, *numbers: int) -> None:
        """Report these keys as released, once each, whether they are down or held back."""
        for number in numbers:
            self._leaving.pop(number, None)
            if (press := self._down.pop(number, None)) is not None:
                self.released.emit(press)

    def _release(self, event: QKeyEvent) -> bool:
        """Release the key of an event, at once or after LEAVE_MS; return True if it plays."""
        number, time_ms = _number(event), event.timestamp()
        press = self._down.get(number)
        if press is None:
            return False
        if self._holds_back:
            self._leaving[number] = time_ms
            QTimer.singleShot(LEAVE_MS, self, lambda: self._leave(number, time_ms))
        else:
            self._let_go(number)
        return (semitone_of(press) if self.piano else place_of(press)) is not None

    def _leave(self, number: int, time_ms: int) -> None:
        """Release a key that was not pressed again, once the events that have come meanwhile are taken."""

        def leave() -> None:
            if self._leaving.get(number) == time_ms:
                self._let_go(number)

        QTimer.singleShot(0, self, leave)


def _number(event: QKeyEvent) -> int:
    """The number of a key: the platform's scan code; Qt's key, negated, where there is none."""
    return event.nativeScanCode() or -event.key()


def _letter(event: QKeyEvent) -> str:
    """The character that is printed on the key; "" for a key without one."""
    key = event.key()
    return chr(key) if 0x21 <= key < 0x7F else ""


def _writes(widget: QWidget) -> bool:
    return isinstance(widget, _WRITING) or (isinstance(widget, QComboBox) and widget.isEditable())
