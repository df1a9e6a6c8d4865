"""Controls: what they say, report, paint and take from mouse and keys."""

from collections.abc import Callable

import pytest
from PySide6.QtCore import QEvent, QPoint, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import (
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QDialog,
    QLabel,
    QLineEdit,
    QPushButton,
    QToolTip,
    QVBoxLayout,
    QWidget,
)
from pytestqt.qtbot import QtBot

from app.views.controls.knob import DRAG_PIXELS, Knob
from app.views.controls.meter import LIMIT_HOLD_TICKS, Meter
from app.views.controls.notice_bar import MOST_KEPT, NoticeBar
from app.views.controls.number_box import NumberBox
from app.views.controls.playing_keys import X11, PlayingKeys
from engine.parameters import Parameter, Taper
from tests.app.gestures import (
    CONTROL,
    LEFT,
    NONE,
    SHIFT,
    keeps,
    move,
    picture,
    press_keys,
    reported,
    turn_wheel,
)


def test_the_limit_light_is_held_and_goes_out(show):
    meter = show(Meter())
    meter.show_level(-60.0, False)
    dark = picture(meter)
    meter.show_level(-60.0, True)
    assert meter.limit_light and picture(meter) != dark
    for _ in range(2 * LIMIT_HOLD_TICKS):
        meter.show_level(-60.0, False)
    assert not meter.limit_light and picture(meter) == dark


def test_a_notice_is_reported_once_counted_when_it_repeats_and_kept(qtbot):
    bar = NoticeBar()
    for widget in (bar, bar.bell):
        qtbot.addWidget(widget)
    bar.report("No sound.", "device 3")
    bar.inform("Disk full.")
    for _ in range(100):
        bar.report("No sound.", "device 4")
    assert [(each.message, each.details, each.error) for each in bar.notices] == [
        ("Disk full.", "", False),
        ("No sound.", "device 4", True),
    ]
    assert bar.bell.unseen == 2
    label = bar.findChild(QLabel)
    assert (label.text(), label.objectName()) == ("No sound.  (×101)", "warning")
    bar.withdraw("Something else.")
    assert bar.text == "No sound."
    bar.withdraw("No sound.")
    for number in range(MOST_KEPT + 5):
        bar.inform(f"Fact {number}.")
    assert (len(bar.notices), label.objectName()) == (MOST_KEPT, "")


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


def test_a_drag_goes_with_the_pointer_finer_with_shift_and_without_a_leap(qtbot, knob):
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


def test_the_wheel_and_keys(knob):
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
        ("99", Key.Key_Return, 20, "At most 20.00 mm"),
        ("-1", Key.Key_Return, 0, "At least 0.00 mm"),
        ("3-", Key.Key_Return, 4.0, "“3-” is no number here, as 4.00 mm is, which is kept"),
        ("9", Key.Key_Escape, 4.0, "4.00 mm is kept"),
        ("7 m", Key.Key_A, 4.0, "4.00 mm is kept"),  # no number has it: it plays
    ],
)
def test_a_number_is_typed(qtbot, knob, text, end, value, words):
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
def test_the_focus_returns_where_it_was_brought(qtbot, knob, reason, end):
    knob.window().setFocus()
    knob.setFocus(reason)
    type_in(qtbot, knob, "7", end)
    assert QApplication.focusWidget() is (knob if reason == Qt.FocusReason.TabFocusReason else knob.window())


def test_value_figure_and_bar_are_seen_and_said(qtbot, knob):
    figures, plain = reported(knob.figure_asked), picture(knob)
    knob.set_value(11)
    assert (knob.accessibleDescription(), picture(knob) != plain) == ("11.00 mm", True)
    knob.show_figure("72.3 N")
    assert knob.accessibleDescription() == "72.3 N (11.00 mm)"
    type_in(qtbot, knob, "8", Key.Key_Return)
    assert (figures, knob.value) == ([8.0], 11.0)
    for words in ("A triangle has no width", ""):
        knob.set_barred(words)
        assert knob.isEnabled() == (not words)
        assert ("no width" in knob.toolTip()) == bool(words)


def type_over(qtbot: QtBot, box: QAbstractSpinBox, text: str) -> None:
    box.selectAll()
    qtbot.keyClicks(box, text)
    qtbot.keyClick(box, Qt.Key.Key_Return)


def test_a_refused_text_leaves_the_value_and_presses_no_button(qtbot, show):
    dialog, button = QDialog(), QPushButton("Do it", default=True)
    box = NumberBox("length", (0, 5), 0.65, "", " m", 3)
    column = QVBoxLayout(dialog)
    for part in (box, button):
        column.addWidget(part)
    pressed, changes = reported(button.clicked), reported(box.valueChanged)
    show(dialog)
    for text in ("", "x", "2.5.1", "0.3 cm", "1e", "65", "-1", "nan"):
        QToolTip.hideText()
        qtbot.waitUntil(lambda: not QToolTip.isVisible())
        box.selectAll()
        qtbot.keyClick(box, Qt.Key.Key_Delete)
        type_over(qtbot, box, text)
        assert (box.value(), box.text(), changes, pressed) == (0.65, "0.650 m", [], []), text
        assert QToolTip.isVisible() and "0.650 m is" in QToolTip.text()
    type_over(qtbot, box, "1,2")
    assert len(pressed) == 1 and box.value() == 1.2


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


def test_a_list_takes_no_notes_and_who_writes_is_left_alone(qtbot, window, hear):
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


def test_a_held_key_is_reported_once_and_shortcuts_are_no_notes(qtbot, window, hear):
    letters = hear("windows")
    qtbot.keyPress(window, Qt.Key.Key_S)
    for _ in range(5):
        QApplication.sendEvent(window, QKeyEvent(DOWN, Qt.Key.Key_S, NONE, "s", True))
    qtbot.keyClick(window, Qt.Key.Key_D, CONTROL)
    assert letters == ["S"]


def test_releases_and_repetitions(qtbot, window, hear):
    """Of two keys together, as the platform gives them: with the key's code and the server's time."""
    for platforms, events, letters in (
        # on X11 a repetition looks like a release and a press
        ([X11], [(DOWN, 1_000), (UP, 1_660), (DOWN, 1_660), (UP, 1_700), (DOWN, 1_700), (UP, 2_000)], "Ss"),
        # struck fast again, it is released first
        ([X11, "windows"], [(DOWN, 1_000), (UP, 1_030), (DOWN, 1_042)], "SsS"),
        # a menu has taken the release
        ([X11, "windows"], [(DOWN, 1_000), (DOWN, 3_000)], "SsS"),
        (["windows", "cocoa", "wayland", X11], [(DOWN, 1_000), (UP, 1_500)], "Ss"),
    ):
        for platform in platforms:
            heard = hear(platform)
            for kind, time_ms in events:
                for key, code in ((Qt.Key.Key_S, 39), (Qt.Key.Key_D, 40)):
                    event = QKeyEvent(kind, key, NONE, code, 0, 0, chr(key).lower())
                    event.setTimestamp(time_ms)
                    QApplication.sendEvent(window, event)
            if platform == X11:
                qtbot.waitUntil(lambda heard=heard, letters=letters: len(heard) >= 2 * len(letters))
            assert [each for each in heard if each in "Ss"] == list(letters), platform
            assert [each for each in heard if each in "Dd"] == list(letters.replace("S", "D").replace("s", "d"))
