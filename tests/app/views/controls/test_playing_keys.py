"""Keys reach the instrument wherever the keyboard is, but never from someone who writes or browses."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QComboBox, QLineEdit, QVBoxLayout, QWidget
from pytestqt.qtbot import QtBot

from app.views.controls.playing_keys import X11, PlayingKeys
from app.views.instrument.patch_card import patch_browser


@pytest.fixture
def window(qtbot: QtBot) -> QWidget:
    made = QWidget()
    qtbot.addWidget(made)
    column = QVBoxLayout(made)
    for child in (QLineEdit(), QComboBox()):
        column.addWidget(child)
    made.findChild(QComboBox).addItems(["first", "a song"])
    made.show()
    return made


@pytest.fixture
def heard(window: QWidget) -> list[str]:
    seen: list[str] = []
    PlayingKeys(window).pressed.connect(lambda press: seen.append(press.letter))
    return seen


def test_a_list_does_not_take_the_notes(qtbot: QtBot, window: QWidget, heard: list[str]) -> None:
    box = window.findChild(QComboBox)
    QApplication.instance().focusChanged.emit(None, box)  # type: ignore[union-attr]
    qtbot.keyClick(box, Qt.Key.Key_A)
    assert heard == ["A"]
    assert box.currentText() == "first"
    QApplication.instance().focusChanged.emit(box, None)  # type: ignore[union-attr]
    qtbot.keyClick(box, Qt.Key.Key_A)
    assert box.currentText() == "a song"


def test_who_writes_is_left_alone(qtbot: QtBot, window: QWidget, heard: list[str]) -> None:
    line = window.findChild(QLineEdit)
    QApplication.instance().focusChanged.emit(None, line)  # type: ignore[union-attr]
    qtbot.keyClicks(line, "asdc1")
    assert (line.text(), heard) == ("asdc1", [])


def test_while_a_browser_is_open_keys_search_in_it(qtbot: QtBot, window: QWidget, heard: list[str]) -> None:
    browser = patch_browser(window)
    browser.show_over()
    box = window.findChild(QComboBox)
    for focused in (browser.list, browser, box, window):
        browser.search.clear()
        QApplication.instance().focusChanged.emit(None, focused)  # type: ignore[union-attr]
        qtbot.keyClicks(focused, "ah")
        assert (browser.search.text(), heard) == ("ah", [])
    assert box.currentText() == "first"
    browser.dismiss()
    qtbot.keyClicks(window, "a")
    assert heard == ["A"]


def test_a_key_that_is_held_down_is_reported_once_and_shortcuts_are_not_notes(
    qtbot: QtBot, window: QWidget, heard: list[str]
) -> None:
    qtbot.keyPress(window, Qt.Key.Key_S)
    for _ in range(5):
        repeated = QKeyEvent(QEvent.Type.KeyPress, Qt.Key.Key_S, Qt.KeyboardModifier.NoModifier, "s", True)
        QApplication.sendEvent(window, repeated)
    qtbot.keyClick(window, Qt.Key.Key_S, Qt.KeyboardModifier.ControlModifier)
    assert heard == ["S"]


def native(kind: QEvent.Type, time_ms: int) -> QKeyEvent:
    """As X11 gives it: with the key's code and the server's time."""
    event = QKeyEvent(kind, Qt.Key.Key_S, Qt.KeyboardModifier.NoModifier, 39, 0, 0, "s")
    event.setTimestamp(time_ms)
    return event


def test_a_repetition_that_looks_like_a_release_and_a_press_is_neither(qtbot: QtBot, window: QWidget) -> None:
    keys, reported = PlayingKeys(window, X11), list[str]()
    keys.pressed.connect(lambda press: reported.append("down"))
    keys.released.connect(lambda press: reported.append("up"))
    QApplication.sendEvent(window, native(QEvent.Type.KeyPress, 1_000))
    for time_ms in (1_660, 1_700, 1_740):
        QApplication.sendEvent(window, native(QEvent.Type.KeyRelease, time_ms))
        QApplication.sendEvent(window, native(QEvent.Type.KeyPress, time_ms))
    qtbot.wait(60)
    assert reported == ["down"]
    QApplication.sendEvent(window, native(QEvent.Type.KeyRelease, 2_000))
    qtbot.waitUntil(lambda: reported == ["down", "up"])


@pytest.mark.parametrize("platform", [X11, "windows"])
def test_a_key_struck_fast_again_is_let_go_first(window: QWidget, platform: str) -> None:
    keys, reported = PlayingKeys(window, platform), list[str]()
    keys.pressed.connect(lambda press: reported.append("down"))
    keys.released.connect(lambda press: reported.append("up"))
    QApplication.sendEvent(window, native(QEvent.Type.KeyPress, 1_000))
    QApplication.sendEvent(window, native(QEvent.Type.KeyRelease, 1_030))
    QApplication.sendEvent(window, native(QEvent.Type.KeyPress, 1_042))
    assert reported == ["down", "up", "down"]


@pytest.mark.parametrize("platform", [X11, "windows"])
def test_a_key_whose_release_was_lost_is_let_go_before_it_is_pressed_again(window: QWidget, platform: str) -> None:
    keys, reported = PlayingKeys(window, platform), list[str]()
    keys.pressed.connect(lambda press: reported.append("down"))
    keys.released.connect(lambda press: reported.append("up"))
    for time_ms in (1_000, 3_000):  # a menu has taken the release between them
        QApplication.sendEvent(window, native(QEvent.Type.KeyPress, time_ms))
    assert reported == ["down", "up", "down"]


@pytest.mark.parametrize("platform", ["windows", "cocoa", "wayland"])
def test_a_release_is_not_held_back_where_qt_marks_repetitions(window: QWidget, platform: str) -> None:
    keys, reported = PlayingKeys(window, platform), list[str]()
    keys.pressed.connect(lambda press: reported.append("down"))
    keys.released.connect(lambda press: reported.append("up"))
    QApplication.sendEvent(window, native(QEvent.Type.KeyPress, 1_000))
    QApplication.sendEvent(window, native(QEvent.Type.KeyRelease, 1_500))
    assert reported == ["down", "up"]


def test_keys_let_go_together_are_all_released(qtbot: QtBot, window: QWidget) -> None:
    keys, reported = PlayingKeys(window, X11), list[str]()
    keys.released.connect(lambda press: reported.append(press.letter))
    for key, code in ((Qt.Key.Key_S, 39), (Qt.Key.Key_D, 40)):
        for kind, time_ms in ((QEvent.Type.KeyPress, 1_000), (QEvent.Type.KeyRelease, 1_500)):
            event = QKeyEvent(kind, key, Qt.KeyboardModifier.NoModifier, code, 0, 0, chr(key))
            event.setTimestamp(time_ms)
            QApplication.sendEvent(window, event)
    qtbot.waitUntil(lambda: sorted(reported) == ["D", "S"])
