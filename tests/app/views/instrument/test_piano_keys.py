"""Where and how the on-screen keyboard is touched is what is played."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.shared.key_names import note_name
from app.views import theme
from app.views.instrument.piano_keys import PianoKeys, is_black, shown_range
from app.views.instrument.playable import HARDEST, SOFTEST
from tests.app.gestures import LEFT, NONE, RIGHT, SHIFT, colour_at, keeps, picture, press_keys, reported

Key = Qt.Key
Notes = list[tuple[str, int]]


@pytest.fixture
def keys(show: Callable[..., PianoKeys]) -> PianoKeys:
    made = show(PianoKeys(), 1001, 100)
    made.set_range(40, 86)
    return made


@pytest.fixture
def notes(keys: PianoKeys, notes_of: Callable[[QWidget], Notes]) -> Notes:
    return notes_of(keys)


def spot(keys: PianoKeys, key: int, share: float = 0.9) -> QPoint:
    """On a key, so far down."""
    rect = keys.key_rect(key)
    return QPointF(rect.center().x(), rect.top() + share * rect.height()).toPoint()


def test_every_key_is_found_where_it_is_drawn(keys: PianoKeys) -> None:
    for key in range(36, 96):
        assert keys.key_at(QPointF(spot(keys, key))) == key, note_name(key)
    assert keys.key_at(QPointF(-1, 5)) is None
    assert keys.key_at(QPointF(5, 100)) is None
    between = (keys.key_rect(61).right() + keys.key_rect(63).left()) / 2
    assert keys.key_at(QPointF(between, 5)) == 62, "between two black keys is the white one"
    for low, high in ((40, 86), (28, 88), (50, 52), (0, 3), (120, 127), (0, 127), (60, 60)):  # within whole octaves
        first, last = shown_range(low, high)
        assert 0 <= first <= low <= high <= last and last - first >= 47
        assert (first % 12, last % 12) == (0, 11)


def test_lower_on_a_key_is_harder(qtbot: QtBot, keys: PianoKeys, notes: Notes) -> None:
    pressed = reported(keys.pressed)
    assert is_black(66)
    for key, share in ((64, 0.0), (64, 0.5), (64, 0.99), (66, 0.97)):
        qtbot.mouseClick(keys, LEFT, pos=spot(keys, key, share))
    softest, middle, *hard = (velocity for _, velocity, *_ in pressed)
    assert (softest, middle) == (SOFTEST, pytest.approx((SOFTEST + HARDEST) / 2, abs=3))
    assert hard == [pytest.approx(HARDEST, abs=3), pytest.approx(HARDEST, abs=8)]
    assert notes == [(what, key) for key in (64, 64, 64, 66) for what in ("on", "off")]


def test_a_drag_is_a_glissando(qtbot: QtBot, keys: PianoKeys, notes: Notes) -> None:
    qtbot.mousePress(keys, LEFT, pos=spot(keys, 60))
    for key in (60, 62, 64):
        qtbot.mouseMove(keys, spot(keys, key))
    qtbot.mouseMove(keys, QPoint(keys.width() + 50, 50))  # beside the keys: the last one continues
    qtbot.mouseRelease(keys, LEFT, pos=spot(keys, 64))
    assert notes == [("on", 60), ("off", 60), ("on", 62), ("off", 62), ("on", 64), ("off", 64)]


@pytest.mark.parametrize(("button", "modifier"), [(RIGHT, NONE), (LEFT, SHIFT)])
def test_a_key_that_is_held_stays_until_it_is_clicked_so_again(
    qtbot: QtBot, keys: PianoKeys, notes: Notes, button: Qt.MouseButton, modifier: Qt.KeyboardModifier
) -> None:
    qtbot.mouseClick(keys, button, modifier, spot(keys, 60))
    assert (notes, keys.held) == ([("on", 60)], {60})
    qtbot.mouseClick(keys, LEFT, pos=spot(keys, 60))  # plucks it again, and it stays
    assert notes == [("on", 60), ("on", 60), ("off", 60)]  # the release of the first stroke
    qtbot.mouseClick(keys, button, modifier, spot(keys, 60))
    assert (notes[3:], keys.held) == ([("off", 60)], set())


@pytest.mark.parametrize("end", ["release_all", "another range", "hide"])
def test_each_stroke_of_a_key_is_released_however_it_was_struck(
    qtbot: QtBot, keys: PianoKeys, notes: Notes, end: str
) -> None:
    qtbot.mouseClick(keys, RIGHT, pos=spot(keys, 60))
    qtbot.mousePress(keys, LEFT, pos=spot(keys, 59))
    for key in (60, 62, 60):  # a glissando over the key that is held
        qtbot.mouseMove(keys, spot(keys, key))
    qtbot.keyPress(keys, Key.Key_Return)
    {"release_all": keys.release_all, "another range": lambda: keys.set_range(28, 60), "hide": keys.hide}[end]()
    for key in (59, 60, 62):
        assert notes.count(("on", key)) == notes.count(("off", key)) > 0


def test_keys_without_a_string_are_grey_and_silent_and_sounding_ones_as_bright_as_they_are_loud(
    qtbot: QtBot, keys: PianoKeys, notes: Notes
) -> None:
    for key in (39, 87):
        qtbot.mouseClick(keys, LEFT, pos=spot(keys, key))
    assert notes == []
    inside, outside = (colour_at(picture(keys), spot(keys, key, 0.75)) for key in (77, 89))
    assert theme.contrast(inside.name(), outside.name()) > 1.5
    colours = []
    for source, level in (("model", 0.0), ("model", 0.3), ("model", 1.0), ("truth", 1.0)):
        keys.show_source(source)
        keys.show_sounding({65: level} if level else {})
        colours.append(colour_at(picture(keys), spot(keys, 65, 0.8)).name())
    assert colours[2:] == [theme.MODEL, theme.TRUTH] and len(set(colours)) == 4


def test_arrows_choose_a_key_and_enter_plays_it(qtbot: QtBot, keys: PianoKeys, notes: Notes) -> None:
    keys.activateWindow()
    keys.setFocus()
    qtbot.waitUntil(keys.hasFocus)
    qtbot.mouseClick(keys, LEFT, pos=spot(keys, 71))
    assert keys.chosen.key == 71
    notes.clear()
    at_rest = picture(keys)
    press_keys(keys, Key.Key_Right, Key.Key_Right, Key.Key_Up)
    assert picture(keys) != at_rest, "the cursor is seen by those who use the keyboard"
    assert keys.chosen.key == 85
    assert "C♯6" in keys.accessibleDescription()
    press_keys(keys, Key.Key_Return, Key.Key_Up, Key.Key_Up)
    assert notes == [("on", 85), ("off", 85)]
    assert keys.chosen.key <= 86, "no further than the strings go"
    assert keeps(keys, Key.Key_Return) and not keeps(keys, Key.Key_Space)
