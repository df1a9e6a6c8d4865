"""A window as its user has it: controls are found by their names, pressed by mouse and keys, and read."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QAbstractButton, QApplication, QComboBox, QWidget
from pytestqt.qtbot import QtBot

from app.instruments.instrument import Instrument
from app.playing.key_note import KeyNote
from app.playing.note import PluckVoices
from app.rendering.subject import string_of
from app.window.controller import Controller
from app.window.panels import Panel

LEFT = Qt.MouseButton.LeftButton
CONTROL, SHIFT = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier
PLAIN = Qt.KeyboardModifier.NoModifier
KEY = Qt.Key
Kind = TypeVar("Kind", bound=QWidget)


def names_of(widget: QWidget) -> list[str]:
    """The words of a screen reader for a widget, and those on it."""
    return [widget.accessibleName(), *([widget.text()] if isinstance(widget, QAbstractButton) else [])]


def find(within: QWidget, kind: type[Kind], name: str = "") -> Kind:
    """The control of this kind whose name or text begins so; of several, the first that can be seen."""
    found = [each for each in within.findChildren(kind) if any(text.startswith(name) for text in names_of(each))]
    assert found, f"no {kind.__name__} {name!r}"
    return min(found, key=lambda each: not each.isVisible())


def press(within: QWidget, name: str) -> None:
    """Click a button."""
    find(within, QAbstractButton, name).click()


def choose(box: QComboBox, data: object) -> None:
    """Choose an entry by what it stands for."""
    row = box.findData(data)
    assert row >= 0, data
    box.setCurrentIndex(row)
    box.activated.emit(row)


def tab_stops(within: QWidget) -> list[QWidget]:
    """What the Tab key can reach, as far as it can be seen; in a group of buttons it is the checked one."""
    return [
        each
        for each in (within, *within.findChildren(QWidget))
        if each.focusPolicy() & Qt.FocusPolicy.TabFocus
        and each.focusProxy() is None
        and each.isEnabled()
        and each.isVisible()
        and each.window() is within.window()
    ]


def by_arrows(control: QWidget) -> bool:
    """Return True if arrow keys lead to it from the one of its group that is checked."""
    return isinstance(control, QAbstractButton) and control.group() is not None and not control.isChecked()


def fits(window: QWidget) -> bool:
    """Return True if the window is no smaller than its parts need."""
    return window.centralWidget().minimumSizeHint().expandedTo(window.size()) == window.size()  # type: ignore[attr-defined]


class Window:
    """A window and its user.

    Attributes:
        struck: the notes that events have begun, in their order.
    """

    def __init__(self, qtbot: QtBot, controller: Controller) -> None:
        self.qtbot, self.controller, self.window = qtbot, controller, controller.window
        self.session, self.performance = controller.session, controller.performance
        self.notes, self.keys = controller.performance.notes, controller.performance.notes.keys
        self.struck: list[Any] = []
        handle = self.notes.handle

        def noted(event: Any, due: Any = None) -> PluckVoices | KeyNote | None:
            if (note := handle(event, due)) is not None:
                self.struck.append(note)
            return note

        self.notes.handle = noted  # type: ignore[method-assign]

    @property
    def choices(self) -> Any:
        return self.session.choices

    @property
    def instrument(self) -> Instrument:
        """The instrument that is there."""
        assert self.choices.instrument is not None
        return self.choices.instrument

    @property
    def rings(self) -> list[Any]:
        """The struck notes that are heard and were not asked to end."""
        return [note for note in self.struck if not note.over and not getattr(note, "released", False)]

    @property
    def said(self) -> list[str]:
        """The notices so far, without the one that there is no device here."""
        return [each.message for each in self.window.notices.notices if "No sound output" not in each.message]

    def wait(self, condition: Callable[[], object]) -> None:
        self.qtbot.waitUntil(lambda: bool(condition()))

    def wait_for_take(self) -> None:
        """Return when what is chosen is rendered; the words alone may be of the pluck before."""
        words = self.window.error_label
        self.wait(lambda: self.performance.ready and "Error of this pluck" in words.text())

    def wait_for_keys(self) -> None:
        """Return when keys play what is chosen."""
        self.wait(lambda: self.keys.player is not None and self.keys.player.instrument == self.choices.instrument)

    def wait_for_string(self) -> None:
        """Return when the string of the key that was struck last is shown."""

        def shown() -> bool:
            note = self.session.stage.note
            known = isinstance(note, KeyNote) and note.request is not None
            return known and string_of(note.request.preset) == self.choices.string  # type: ignore[union-attr]

        self.wait(shown)

    def find(self, kind: type[Kind], name: str = "") -> Kind:
        return find(self.window, kind, name)

    def press(self, name: str) -> None:
        press(self.window, name)

    def key(self, key: Any, held: Qt.KeyboardModifier = PLAIN, on: QWidget | None = None) -> None:
        """Press and release a key of the computer."""
        self.qtbot.keyClick(on or self.window, key, held)

    def play(self, key: int, velocity: int = 100, hold: bool = False) -> None:
        """Strike a key on the screen."""
        self.window.instrument.pressed.emit(key, velocity, None)
        if not hold:
            self.window.instrument.released.emit(key, None)

    def sounds(self, *keys: int) -> None:
        """Return when these keys ring, and no others."""
        self.wait(lambda: self.keys.sounding().keys() == set(keys))

    def pluck(self) -> Any:
        """Pluck the chosen string; its note."""
        self.controller.pluck()
        return self.struck[-1]

    def choose(self, instrument: str) -> None:
        """Choose an instrument, and return when keys play it."""
        self.controller.instruments.choose(instrument)
        self.wait_for_keys()

    def change(self, **choices: Any) -> None:
        self.session.update(**choices)

    def panel(self, key: str) -> Any:
        """A panel, brought to the front of its deck."""
        (panel,) = (each for each in self.controller.panels if each.key == key)
        if panel.location != "stage":
            self.change(**{f"{panel.location}_view": key})
        return panel

    @property
    def panels(self) -> list[Panel]:
        return self.controller.panels

    def drop(self, *files: Path) -> None:
        """Drop files, as from a file manager that proposes to move them."""
        data = QMimeData()
        data.setUrls([QUrl.fromLocalFile(str(file)) for file in files])
        both = Qt.DropAction.CopyAction | Qt.DropAction.MoveAction
        for event in (
            QDragEnterEvent(QPoint(50, 50), both, data, LEFT, PLAIN),
            QDropEvent(QPointF(50, 50), both, data, LEFT, PLAIN),
        ):
            event.setDropAction(Qt.DropAction.MoveAction)
            QApplication.sendEvent(self.window, event)
            assert event.isAccepted() and event.dropAction() == Qt.DropAction.CopyAction

    def drag(self, widget: QWidget, *places: QPoint) -> None:
        """Press the mouse at the first place, and release it at the last."""
        self.qtbot.mousePress(widget, LEFT, pos=places[0])
        for place in places[1:]:
            self.qtbot.mouseMove(widget, place)
        self.qtbot.mouseRelease(widget, LEFT, pos=places[-1])

    def tab_to(self, aim: QWidget) -> None:
        """Press the Tab key until `aim` has the keyboard."""
        for _ in range(200):
            self.key(KEY.Key_Tab, on=self.window.focusWidget())
            if self.window.focusWidget() is aim:
                return
        raise AssertionError(f"Tab never came to {aim}")

    def close(self) -> None:
        """Close it, without a question about what a test leaves."""
        self.window.may_close = lambda: True
        self.window.close()
