"""Keys reach the instrument wherever the keyboard is, but never from someone who writes or browses."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QComboBox, QLineEdit, QVBoxLayout, QWidget
from pytestqt.qtbot import QtBot

from app.views.controls.playing_keys import X11, PlayingKeys
from tests.app.gestures import CONTROL, NONE

DOWN, UP = QEvent.Type.KeyPress, QEvent.Type.KeyRelease
Hear = Callable[[str], list[str]]


@pytest.fixture
def window(qtbot: QtBot) -> QWidget:
    """A line, and a list of which the second entry begins with an A."""
    made = QWidget()
    qtbot.addWidget(made)
    column = QVBoxLayout(made)
    for child in (QLineEdit(), QComboBox()):
        column.addWidget(child)
    made.findChild(QComboBox).addItems(["first", "a song"])
    made.show()
    return made


@pytest.fixture
def hear(window: QWidget) -> Hear:
    """The letters from now on: S as it is pressed, s as it is released."""

    def begin(platform: str) -> list[str]:
        letters: list[str] = []
        keys = PlayingKeys(window, platform)
        keys.pressed.connect(lambda press: letters.append(press.letter))
        keys.released.connect(lambda press: letters.append(press.letter.lower()))
        return letters

    return begin


def focus(widget: QWidget | None) -> None:
    QApplication.instance().focusChanged.emit(None, widget)  # type: ignore[union-attr]


def test_a_list_does_not_take_the_notes_and_who_writes_is_left_alone(
    qtbot: QtBot, window: QWidget, hear: Hear
) -> None:
    letters, box, line = hear("windows"), window.findChild(QComboBox), window.findChild(QLineEdit)
    for focused, heard, text, chosen in (
        (box, ["A", "a"], "", "first"),
        (line, [], "a", "first"),
        (None, [], "a", "a song"),
    ):
        letters.clear()
        focus(focused)
        qtbot.keyClicks(focused or box, "a")
        assert (letters, line.text(), box.currentText()) == (heard, text, chosen)


def test_a_key_that_is_held_down_is_reported_once_and_shortcuts_are_not_notes(
    qtbot: QtBot, window: QWidget, hear: Hear
) -> None:
    letters = hear("windows")
    qtbot.keyPress(window, Qt.Key.Key_S)
    for _ in range(5):
        QApplication.sendEvent(window, QKeyEvent(DOWN, Qt.Key.Key_S, NONE, "s", True))
    qtbot.keyClick(window, Qt.Key.Key_D, CONTROL)
    assert letters == ["S"]


@pytest.mark.parametrize(
    ("platforms", "events", "letters"),
    [
        # on X11 a repetition looks like a release and a press
        ([X11], [(DOWN, 1_000), (UP, 1_660), (DOWN, 1_660), (UP, 1_700), (DOWN, 1_700), (UP, 2_000)], "Ss"),
        # struck fast again, it is released first
        ([X11, "windows"], [(DOWN, 1_000), (UP, 1_030), (DOWN, 1_042)], "SsS"),
        # a menu has taken the release
        ([X11, "windows"], [(DOWN, 1_000), (DOWN, 3_000)], "SsS"),
        (["windows", "cocoa", "wayland", X11], [(DOWN, 1_000), (UP, 1_500)], "Ss"),
    ],
)
def test_releases_and_repetitions(
    qtbot: QtBot,
    window: QWidget,
    hear: Hear,
    platforms: list[str],
    events: list[tuple[QEvent.Type, int]],
    letters: str,
) -> None:
    """Of two keys together, as the platform gives them: with the key's code and the server's time."""
    for platform in platforms:
        heard = hear(platform)
        for kind, time_ms in events:
            for key, code in ((Qt.Key.Key_S, 39), (Qt.Key.Key_D, 40)):
                event = QKeyEvent(kind, key, NONE, code, 0, 0, chr(key).lower())
                event.setTimestamp(time_ms)
                QApplication.sendEvent(window, event)
        if platform == X11:
            qtbot.waitUntil(lambda heard=heard: len(heard) >= 2 * len(letters))
        of_s = [letter for letter in heard if letter in "Ss"]
        of_d = [letter.replace("D", "S").replace("d", "s") for letter in heard if letter in "Dd"]
        assert of_s == of_d == list(letters)
