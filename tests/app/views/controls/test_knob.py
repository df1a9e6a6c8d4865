"""A knob asks for what the hand wants, and shows what became of it."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QKeyEvent, QMouseEvent, QWheelEvent
from PySide6.QtWidgets import QApplication, QPushButton, QToolTip, QWidget
from pytestqt.qtbot import QtBot

from app.shared.parameters import Parameter, Taper
from app.views.controls.knob import DRAG_PIXELS, Knob
from app.views.controls.playing_keys import PlayingKeys

LEFT = Qt.MouseButton.LeftButton
SHIFT, NONE = Qt.KeyboardModifier.ShiftModifier, Qt.KeyboardModifier.NoModifier


@pytest.fixture
def knob(qtbot: QtBot) -> Knob:
    """From 0 to 20 by 0.25, at 4; it follows what is asked."""
    made = Knob(Parameter("a", "amplitude", (0, 20), 4.0, Taper(0.25, "{:.2f} mm")))
    qtbot.addWidget(made)
    made.value_asked.connect(made.set_value)
    made.show()
    return made


def move(knob: Knob, up: float, held: Qt.KeyboardModifier) -> None:
    """The pointer goes up from where it was pressed or was last."""
    at = QPointF(30, 40 - up)
    event = QMouseEvent(QEvent.Type.MouseMove, at, knob.mapToGlobal(at), LEFT, LEFT, held)
    QApplication.sendEvent(knob, event)


def test_a_drag_goes_with_the_pointer_and_shows_the_value(qtbot: QtBot, knob: Knob) -> None:
    qtbot.mousePress(knob, LEFT, pos=QPoint(30, 40))
    move(knob, DRAG_PIXELS / 4, NONE)
    assert knob.value == pytest.approx(9)
    assert QToolTip.text() == "9.00 mm"
    move(knob, -2 * DRAG_PIXELS, NONE)
    assert knob.value == 0
    qtbot.mouseRelease(knob, LEFT)
    move(knob, 0, NONE)
    assert knob.value == 0


def test_shift_in_the_middle_of_a_drag_is_finer_and_does_not_leap(qtbot: QtBot, knob: Knob) -> None:
    qtbot.mousePress(knob, LEFT, pos=QPoint(30, 40))
    move(knob, 45, NONE)
    assert knob.value == pytest.approx(9)
    move(knob, 45, SHIFT)
    assert knob.value == pytest.approx(9)
    move(knob, 54, SHIFT)
    assert knob.value == pytest.approx(9.1)
    move(knob, 63, NONE)
    assert knob.value == pytest.approx(10.1)
    qtbot.mouseRelease(knob, LEFT)


def test_a_drag_reports_its_begin_and_its_end(qtbot: QtBot, knob: Knob) -> None:
    with qtbot.waitSignals([knob.drag_started, knob.drag_ended], order="strict"):
        qtbot.mousePress(knob, LEFT)
        qtbot.mouseRelease(knob, LEFT)


@pytest.mark.parametrize(
    ("delta", "held", "value"),
    [((0, 120), NONE, 4.25), ((0, -240), NONE, 3.5), ((0, 120), SHIFT, 4.025), ((120, 0), SHIFT, 4.025)],
)
def test_the_wheel(knob: Knob, delta: tuple[int, int], held: Qt.KeyboardModifier, value: float) -> None:
    at = QPointF(30, 40)
    event = QWheelEvent(
        at, at, QPoint(), QPoint(*delta), Qt.MouseButton.NoButton, held, Qt.ScrollPhase.NoScrollPhase, False
    )
    QApplication.sendEvent(knob, event)
    assert knob.value == pytest.approx(value)
    assert event.isAccepted()


@pytest.mark.parametrize(
    ("key", "held", "value"),
    [
        (Qt.Key.Key_Up, NONE, 4.25),
        (Qt.Key.Key_Left, NONE, 3.75),
        (Qt.Key.Key_Right, SHIFT, 4.025),
        (Qt.Key.Key_PageUp, NONE, 6.5),
        (Qt.Key.Key_PageDown, NONE, 1.5),
        (Qt.Key.Key_Home, NONE, 0),
        (Qt.Key.Key_End, NONE, 20),
    ],
)
def test_keys(qtbot: QtBot, knob: Knob, key: Qt.Key, held: Qt.KeyboardModifier, value: float) -> None:
    qtbot.keyClick(knob, key, held)
    assert knob.value == pytest.approx(value)


def test_page_keys_are_the_knobs_and_not_the_windows(knob: Knob) -> None:
    for key, accepted in ((Qt.Key.Key_PageUp, True), (Qt.Key.Key_Space, False)):
        event = QKeyEvent(QEvent.Type.ShortcutOverride, key, NONE)
        event.ignore()
        QApplication.sendEvent(knob, event)
        assert event.isAccepted() == accepted


@pytest.mark.parametrize(
    ("typed", "value", "reported"),
    [
        ("7,5", 7.5, ""),
        ("7.5 mm", 7.5, ""),
        ("1,000.5e-2", 10.005, ""),
        ("99", 20, "At most 20.00 mm"),
        ("-1", 0, "At least 0.00 mm"),
        ("3-", 4.0, "“3-” is no number here, as 4.00 mm is, which is kept"),
        ("3 m", 4.0, "“3 m” is no number here, as 4.00 mm is, which is kept"),
    ],
)
def test_a_typed_number_is_taken_within_the_range(
    qtbot: QtBot, knob: Knob, typed: str, value: float, reported: str
) -> None:
    QToolTip.hideText()
    qtbot.waitUntil(lambda: not QToolTip.isVisible())
    qtbot.keyClicks(knob, typed[0])
    assert knob._editor is not None
    qtbot.keyClicks(knob._editor, typed[1:])
    qtbot.keyClick(knob._editor, Qt.Key.Key_Return)
    assert knob.value == value
    assert knob._editor is None
    assert (QToolTip.text() if QToolTip.isVisible() else "") == reported


def test_escape_gives_typing_up(qtbot: QtBot, knob: Knob) -> None:
    qtbot.keyClicks(knob, "9")
    assert knob._editor is not None
    qtbot.keyClick(knob._editor, Qt.Key.Key_Escape)
    assert (knob.value, knob._editor) == (4.0, None)


def test_double_click_and_delete_reset(qtbot: QtBot, knob: Knob) -> None:
    for reset in (lambda: qtbot.mouseDClick(knob, LEFT), lambda: qtbot.keyClick(knob, Qt.Key.Key_Delete)):
        knob.set_value(12)
        reset()
        assert knob.value == 4.0


def test_what_became_of_it_is_seen_and_said(knob: Knob) -> None:
    assert knob.accessibleDescription() == "4.00 mm"
    before = knob.grab().toImage()
    knob.set_value(11)
    assert knob.grab().toImage() != before
    assert knob.accessibleDescription() == "11.00 mm"
    knob.setEnabled(False)
    assert knob.grab().toImage() != before


def test_a_figure_is_shown_instead_of_the_value_and_typed(qtbot: QtBot, knob: Knob) -> None:
    figures: list[float] = []
    knob.figure_asked.connect(figures.append)
    before = knob.grab().toImage()
    knob.show_figure("72.3 N")
    assert knob.grab().toImage() != before
    assert knob.accessibleDescription() == "72.3 N (4.00 mm)"
    assert "72.3 N (4.00 mm)" in knob.toolTip()
    qtbot.keyClicks(knob, "8")
    assert knob._editor is not None
    qtbot.keyClick(knob._editor, Qt.Key.Key_Return)
    assert (figures, knob.value) == ([8.0], 4.0)
    knob.show_figure("")
    assert knob.accessibleDescription() == "4.00 mm"


def test_a_barred_knob_says_why(knob: Knob) -> None:
    knob.set_barred("A triangle has no width")
    assert not knob.isEnabled()
    assert knob.toolTip() == "amplitude\nA triangle has no width"
    knob.set_barred("")
    assert knob.isEnabled()
    assert "no width" not in knob.toolTip()


def test_a_letter_that_no_number_has_gives_typing_up_and_goes_on(qtbot: QtBot) -> None:
    """Else keys that play would be caught by a digit that was meant for the velocity."""
    window, heard = QWidget(), []
    qtbot.addWidget(window)
    knob = Knob(Parameter("a", "amplitude", (0, 20), 4.0, Taper(0.25, "{:.2f} mm")), window)
    PlayingKeys(window).pressed.connect(lambda press: heard.append(press.letter))
    window.show()
    window.activateWindow()
    qtbot.mouseClick(knob, LEFT, pos=QPoint(30, 40))
    qtbot.keyClicks(knob, "7")
    editor = knob._editor
    assert editor is not None
    qtbot.keyClicks(editor, " m")
    assert (knob._editor, heard) == (editor, [])
    qtbot.keyClick(editor, Qt.Key.Key_A, SHIFT)
    assert (knob._editor, knob.value) == (None, 4.0)
    assert "4.00 mm is kept" in QToolTip.text()


@pytest.mark.parametrize("end", [Qt.Key.Key_Return, Qt.Key.Key_Escape, Qt.Key.Key_A])
@pytest.mark.parametrize("reason", [Qt.FocusReason.MouseFocusReason, Qt.FocusReason.TabFocusReason])
def test_the_focus_returns_to_playing_or_where_keys_had_brought_it(
    qtbot: QtBot, reason: Qt.FocusReason, end: Qt.Key
) -> None:
    window, heard = QWidget(), []
    qtbot.addWidget(window)
    knob = Knob(Parameter("a", "amplitude", (0, 20), 4.0, Taper(0.25, "{:.2f} mm")), window)
    PlayingKeys(window).pressed.connect(lambda press: heard.append(press.letter))
    window.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    window.setFocus()
    knob.setFocus(reason)
    qtbot.keyClicks(knob, "7")
    assert knob._editor is not None and knob._editor.hasFocus()
    qtbot.keyClick(knob._editor, end)
    assert knob._editor is None
    by_keys = reason == Qt.FocusReason.TabFocusReason
    assert QApplication.focusWidget() is (knob if by_keys else window)
    assert heard == (["A"] if end == Qt.Key.Key_A else [])
    qtbot.keyClicks(QApplication.focusWidget(), "8")
    assert (knob._editor is not None) == by_keys
    assert heard[-1:] == ([] if by_keys and end != Qt.Key.Key_A else ["A"] if by_keys else ["8"])


def test_another_widget_that_is_clicked_keeps_the_focus(qtbot: QtBot) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    knob = Knob(Parameter("a", "amplitude", (0, 20), 4.0, Taper(0.25, "{:.2f} mm")), window)
    other = QPushButton("other", window)
    knob.value_asked.connect(knob.set_value)
    window.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    qtbot.keyClicks(knob, "7")
    assert knob._editor is not None and knob._editor.hasFocus()
    other.setFocus(Qt.FocusReason.MouseFocusReason)
    assert (knob.value, knob._editor) == (7.0, None)
    assert other.hasFocus()
