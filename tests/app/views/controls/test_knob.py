"""A knob asks for what a gesture wants, and shows what became of it."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QApplication, QLineEdit, QToolTip, QWidget
from pytestqt.qtbot import QtBot

from app.shared.parameters import Parameter, Taper
from app.views.controls.knob import DRAG_PIXELS, Knob
from app.views.controls.playing_keys import PlayingKeys
from tests.app.gestures import LEFT, NONE, SHIFT, keeps, move, picture, press_keys, reported, turn_wheel

PRESSED = QPoint(30, 40)
Key = Qt.Key


@pytest.fixture
def knob(qtbot: QtBot, show: Callable[..., QWidget]) -> Knob:
    """From 0 to 20 by 0.25, at 4, in an active window; it follows what is asked."""
    window = QWidget()
    made = Knob(Parameter("a", "amplitude", (0, 20), 4.0, Taper(0.25, "{:.2f} mm")), window)
    made.resize(made.sizeHint())
    made.value_asked.connect(made.set_value)
    show(window).activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    return made


def type_in(qtbot: QtBot, knob: Knob, text: str, end: Qt.Key) -> None:
    """Type with the knob's editor, which is gone after the last key."""
    qtbot.keyClicks(knob, text[0])
    editor = knob.findChild(QLineEdit)
    assert editor.hasFocus()
    qtbot.keyClicks(editor, text[1:])
    qtbot.keyClick(editor, end)
    qtbot.waitUntil(lambda: knob.findChild(QLineEdit) is None)


def test_a_drag_goes_with_the_pointer_finer_with_shift_and_without_a_leap(qtbot: QtBot, knob: Knob) -> None:
    drags = reported(knob.drag_started, knob.drag_ended)
    qtbot.mousePress(knob, LEFT, pos=PRESSED)
    up = 0
    for pixels, held, value in (
        (DRAG_PIXELS // 4, NONE, 9),
        (0, SHIFT, 9),
        (9, SHIFT, 9.1),
        (9, NONE, 10.1),
        (-2 * DRAG_PIXELS, NONE, 0),
    ):
        up += pixels
        move(knob, PRESSED - QPoint(0, up), held=held)
        assert knob.value == pytest.approx(value)
        assert QToolTip.text() == f"{value:.2f} mm"
    qtbot.mouseRelease(knob, LEFT)
    move(knob, PRESSED)
    assert knob.value == 0
    assert drags == [(), ()]


def test_the_wheel_and_keys(knob: Knob) -> None:
    for turned, held, value in (
        ((0, 120), NONE, 4.25),
        ((0, -240), NONE, 3.5),
        ((0, 120), SHIFT, 4.025),
        ((120, 0), SHIFT, 4.025),
    ):
        knob.set_value(4.0)
        assert turn_wheel(knob, PRESSED, QPoint(*turned), held)
        assert knob.value == pytest.approx(value)
    for key, held, value in (
        (Key.Key_Up, NONE, 12.25),
        (Key.Key_Left, NONE, 11.75),
        (Key.Key_Right, SHIFT, 12.025),
        (Key.Key_PageUp, NONE, 14.5),
        (Key.Key_PageDown, NONE, 9.5),
        (Key.Key_Home, NONE, 0),
        (Key.Key_End, NONE, 20),
        (Key.Key_Delete, NONE, 4),
    ):
        knob.set_value(12.0)
        press_keys(knob, key, held=held)
        assert knob.value == pytest.approx(value), key
        assert keeps(knob, key) == (key in (Key.Key_PageUp, Key.Key_PageDown))  # shortcuts of the window


@pytest.mark.parametrize(
    ("text", "end", "value", "words"),
    [
        ("7,5", Key.Key_Return, 7.5, ""),
        ("7.5 mm", Key.Key_Return, 7.5, ""),
        ("1,000.5e-2", Key.Key_Return, 10.005, ""),
        ("99", Key.Key_Return, 20, "At most 20.00 mm"),
        ("-1", Key.Key_Return, 0, "At least 0.00 mm"),
        ("3-", Key.Key_Return, 4.0, "“3-” is no number here, as 4.00 mm is, which is kept"),
        ("9", Key.Key_Escape, 4.0, "4.00 mm is kept"),
        ("7 m", Key.Key_A, 4.0, "4.00 mm is kept"),  # no number has it: it plays
    ],
)
def test_a_number_is_typed(qtbot: QtBot, knob: Knob, text: str, end: Qt.Key, value: float, words: str) -> None:
    QToolTip.hideText()
    qtbot.waitUntil(lambda: not QToolTip.isVisible())
    letters: list[str] = []
    PlayingKeys(knob.window()).pressed.connect(lambda press: letters.append(press.letter))
    type_in(qtbot, knob, text, end)
    assert knob.value == value
    assert (QToolTip.text() if QToolTip.isVisible() else "") == words
    assert letters == (["A"] if end == Key.Key_A else [])


@pytest.mark.parametrize("end", [Key.Key_Return, Key.Key_Escape])
@pytest.mark.parametrize("reason", [Qt.FocusReason.MouseFocusReason, Qt.FocusReason.TabFocusReason])
def test_the_focus_returns_to_playing_or_where_keys_had_brought_it(
    qtbot: QtBot, knob: Knob, reason: Qt.FocusReason, end: Qt.Key
) -> None:
    knob.window().setFocus()
    knob.setFocus(reason)
    type_in(qtbot, knob, "7", end)
    assert QApplication.focusWidget() is (knob if reason == Qt.FocusReason.TabFocusReason else knob.window())


def test_value_figure_and_bar_are_seen_and_said(qtbot: QtBot, knob: Knob) -> None:
    figures, pictures = reported(knob.figure_asked), [picture(knob)]

    def changed() -> str:
        pictures.append(picture(knob))
        assert pictures[-1] != pictures[-2]
        return knob.accessibleDescription()

    knob.set_value(11)
    assert changed() == "11.00 mm"
    knob.show_figure("72.3 N")
    assert changed() == "72.3 N (11.00 mm)"
    assert "72.3 N (11.00 mm)" in knob.toolTip()
    type_in(qtbot, knob, "8", Key.Key_Return)
    assert (figures, knob.value) == ([8.0], 11.0)
    knob.show_figure("")
    assert changed() == "11.00 mm"
    knob.set_barred("A triangle has no width")
    changed()
    assert not knob.isEnabled()
    assert knob.toolTip() == "amplitude\nA triangle has no width"
    knob.set_barred("")
    assert knob.isEnabled()
    assert "no width" not in knob.toolTip()
