"""Where and how the on-screen keyboard is touched is what is played."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.shared.key_names import note_name
from app.views import theme
from app.views.instrument.piano_keys import PianoKeys, is_black, shown_range
from app.views.instrument.playable import HARDEST, SOFTEST

LEFT, RIGHT = Qt.MouseButton.LeftButton, Qt.MouseButton.RightButton
SHIFT = Qt.KeyboardModifier.ShiftModifier


class Heard:
    """What was asked, in order: ("on", key) and ("off", key); the velocities beside."""

    def __init__(self, keys: PianoKeys) -> None:
        self.notes: list[tuple[str, int]] = []
        self.velocities: list[int] = []
        keys.pressed.connect(self._on)
        keys.released.connect(lambda key: self.notes.append(("off", key)))

    def _on(self, key: int, velocity: int) -> None:
        self.notes.append(("on", key))
        self.velocities.append(velocity)


@pytest.fixture
def keys(qtbot: QtBot) -> PianoKeys:
    made = PianoKeys()
    qtbot.addWidget(made)
    made.resize(1001, 100)
    made.set_range(40, 86)
    made.show()
    return made


@pytest.fixture
def heard(keys: PianoKeys) -> Heard:
    return Heard(keys)


def spot(keys: PianoKeys, key: int, share: float = 0.9) -> QPoint:
    """On a key, so far down."""
    rect = keys.key_rect(key)
    return QPointF(rect.center().x(), rect.top() + share * rect.height()).toPoint()


def test_every_key_is_found_where_it_is_drawn(keys: PianoKeys) -> None:
    for key in range(36, 96):
        assert keys.key_at(QPointF(spot(keys, key))) == key, note_name(key)
    assert keys.key_at(QPointF(-1, 5)) is None
    assert keys.key_at(QPointF(5, 100)) is None


def test_between_two_black_keys_is_the_white_one(keys: PianoKeys) -> None:
    between = (keys.key_rect(61).right() + keys.key_rect(63).left()) / 2
    assert keys.key_at(QPointF(between, 5)) == 62


@pytest.mark.parametrize(("low", "high"), [(40, 86), (28, 88), (50, 52), (0, 3), (120, 127), (0, 127), (60, 60)])
def test_whole_octaves_hold_the_range(low: int, high: int) -> None:
    first, last = shown_range(low, high)
    assert first <= low <= high <= last
    assert first % 12 == 0
    assert last % 12 == 11
    assert last - first + 1 >= 48
    assert first >= 0


def test_lower_on_a_key_is_harder(qtbot: QtBot, keys: PianoKeys, heard: Heard) -> None:
    for share in (0.0, 0.5, 0.99):
        qtbot.mouseClick(keys, LEFT, pos=spot(keys, 64, share))
    soft, middle, hard = heard.velocities
    assert soft == SOFTEST
    assert middle == pytest.approx((SOFTEST + HARDEST) / 2, abs=3)
    assert hard == pytest.approx(HARDEST, abs=3)
    assert heard.notes == 3 * [("on", 64), ("off", 64)]


def test_a_black_key_has_all_velocities_too(qtbot: QtBot, keys: PianoKeys, heard: Heard) -> None:
    assert is_black(66)
    qtbot.mouseClick(keys, LEFT, pos=spot(keys, 66, 0.97))
    assert heard.velocities[0] > HARDEST - 8


def test_a_drag_is_a_glissando(qtbot: QtBot, keys: PianoKeys, heard: Heard) -> None:
    qtbot.mousePress(keys, LEFT, pos=spot(keys, 60))
    for key in (60, 62, 64):
        qtbot.mouseMove(keys, spot(keys, key))
    qtbot.mouseMove(keys, QPoint(keys.width() + 50, 50))  # beside the keys: the last one continues
    qtbot.mouseRelease(keys, LEFT, pos=spot(keys, 64))
    assert heard.notes == [("on", 60), ("off", 60), ("on", 62), ("off", 62), ("on", 64), ("off", 64)]


@pytest.mark.parametrize(("button", "modifier"), [(RIGHT, Qt.KeyboardModifier.NoModifier), (LEFT, SHIFT)])
def test_a_key_that_is_held_stays_until_it_is_clicked_so_again(
    qtbot: QtBot, keys: PianoKeys, heard: Heard, button: Qt.MouseButton, modifier: Qt.KeyboardModifier
) -> None:
    qtbot.mouseClick(keys, button, modifier, spot(keys, 60))
    assert heard.notes == [("on", 60)]
    assert keys.held == {60}
    qtbot.mouseClick(keys, LEFT, pos=spot(keys, 60))  # plucks it again, and it stays
    assert heard.notes == [("on", 60), ("on", 60), ("off", 60)]  # the release of the first stroke
    qtbot.mouseClick(keys, button, modifier, spot(keys, 60))
    assert heard.notes[3:] == [("off", 60)]
    assert not keys.held


def test_each_stroke_of_a_key_is_released_however_it_was_struck(qtbot: QtBot, keys: PianoKeys, heard: Heard) -> None:
    qtbot.mouseClick(keys, RIGHT, pos=spot(keys, 60))
    qtbot.mousePress(keys, LEFT, pos=spot(keys, 59))
    for key in (60, 62, 60):  # a glissando over the key that is held
        qtbot.mouseMove(keys, spot(keys, key))
    qtbot.keyPress(keys, Qt.Key.Key_Return)
    keys.release_all()
    for key in (59, 60, 62):
        assert heard.notes.count(("on", key)) == heard.notes.count(("off", key)) > 0


def test_a_key_without_a_string_is_grey_and_silent(qtbot: QtBot, keys: PianoKeys, heard: Heard) -> None:
    for key in (39, 87):
        qtbot.mouseClick(keys, LEFT, pos=spot(keys, key))
    assert heard.notes == []
    picture = keys.grab().toImage()
    ratio = picture.devicePixelRatio()
    inside, outside = (picture.pixelColor(*_at(spot(keys, key, 0.75), ratio)) for key in (77, 89))
    assert theme.contrast(inside.name(), outside.name()) > 1.5


def _at(point: QPoint, ratio: float) -> tuple[int, int]:
    return round(point.x() * ratio), round(point.y() * ratio)


def test_what_sounds_is_seen_as_loud_as_it_is(keys: PianoKeys) -> None:
    at = _at(spot(keys, 65, 0.8), keys.grab().devicePixelRatio())
    colours = []
    for level in (0.0, 0.3, 1.0):
        keys.show_sounding({65: level} if level else {})
        colours.append(keys.grab().toImage().pixelColor(*at))
    assert colours[2].name() == theme.MODEL
    assert len({colour.name() for colour in colours}) == 3
    keys.show_source("truth")
    assert keys.grab().toImage().pixelColor(*at).name() == theme.TRUTH


def test_letters_are_printed_on_the_keys_that_they_play(keys: PianoKeys) -> None:
    bare = keys.grab(keys.key_rect(60).toRect()).toImage()
    beside = keys.grab(keys.key_rect(76).toRect()).toImage()
    keys.show_letters({60: "A", 61: "W"})
    assert keys.grab(keys.key_rect(60).toRect()).toImage() != bare
    assert keys.grab(keys.key_rect(76).toRect()).toImage() == beside


def test_another_range_releases_what_is_held(qtbot: QtBot, keys: PianoKeys, heard: Heard) -> None:
    qtbot.mouseClick(keys, RIGHT, pos=spot(keys, 60))
    keys.set_range(28, 60)
    assert heard.notes == [("on", 60), ("off", 60)]


def test_hidden_keys_do_not_go_on_sounding(qtbot: QtBot, keys: PianoKeys, heard: Heard) -> None:
    qtbot.mousePress(keys, LEFT, pos=spot(keys, 62))
    keys.hide()
    assert heard.notes == [("on", 62), ("off", 62)]


def test_arrows_choose_a_key_and_enter_plays_it(qtbot: QtBot, keys: PianoKeys, heard: Heard) -> None:
    for key in (Qt.Key.Key_Right, Qt.Key.Key_Right, Qt.Key.Key_Up):
        qtbot.keyClick(keys, key)
    assert keys.chosen.key == 74
    assert "D5" in keys.accessibleDescription()
    qtbot.keyClick(keys, Qt.Key.Key_Return)
    assert heard.notes == [("on", 74), ("off", 74)]
    qtbot.keyClick(keys, Qt.Key.Key_Up)
    qtbot.keyClick(keys, Qt.Key.Key_Up)
    assert keys.chosen.key == 86, "no further than the strings go"


def test_the_cursor_is_where_one_clicked_and_seen_by_those_who_use_the_keyboard(
    qtbot: QtBot, keys: PianoKeys, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(keys, "hasFocus", lambda: True)  # a window without a desktop is never active
    qtbot.mouseClick(keys, LEFT, pos=spot(keys, 71))
    at_rest = keys.grab().toImage()
    assert keys.chosen.key == 71
    qtbot.keyClick(keys, Qt.Key.Key_Right)
    assert keys.chosen.key == 72
    assert keys.grab().toImage() != at_rest


def test_enter_is_the_keys_own_and_not_the_windows(keys: PianoKeys) -> None:
    for key, accepted in ((Qt.Key.Key_Return, True), (Qt.Key.Key_Space, False)):
        event = QKeyEvent(QEvent.Type.ShortcutOverride, key, Qt.KeyboardModifier.NoModifier)
        event.ignore()
        QApplication.sendEvent(keys, event)
        assert event.isAccepted() == accepted
