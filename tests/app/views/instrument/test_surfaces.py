"""Neck and keys: where and how they are touched is what is played, and what sounds is seen on them."""

import itertools
from collections.abc import Callable

import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtWidgets import QApplication, QWidget

from app.playing.keys import SoundingNote
from app.shared.key_names import note_name
from app.views.instrument.neck import Neck, fret_share
from app.views.instrument.piano_keys import PianoKeys, is_black, shown_range
from app.views.instrument.playable import HARDEST, SOFTEST
from tests.app.gestures import (
    CONTROL,
    LEFT,
    NONE,
    RIGHT,
    SHIFT,
    drag,
    move,
    picture,
    press_keys,
    reported,
)

GUITAR = (("E2", 40), ("A2", 45), ("D3", 50), ("G3", 55), ("B3", 59), ("E4", 64))
NUMBERS = QPoint(500, 108)  # beneath the neck
Key = Qt.Key
Notes = list[tuple[str, int]]


@pytest.fixture
def neck(show: Callable[..., Neck]) -> Neck:
    made = show(Neck(), 1000, 110)
    made.set_strings(GUITAR)
    made.set_range(40, 86)
    return made


def notes_of(surface: QWidget) -> Notes:
    """What a surface asks for from now on, in order: ("on", key) and ("off", key)."""
    notes: Notes = []
    for what, signal in (("on", surface.pressed), ("off", surface.released)):  # type: ignore[attr-defined]
        signal.connect(lambda key, *_, what=what: notes.append((what, key)))
    return notes


@pytest.fixture
def notes(neck: Neck) -> Notes:
    return notes_of(neck)


def on(neck: Neck, string: int, fret: int, share: float = 0.5) -> QPoint:
    cell = neck.cell(string, fret)
    return QPointF(cell.center().x(), cell.top() + share * cell.height()).toPoint()


def test_frets_lie_where_those_of_a_string_do():
    assert (fret_share(0, 24), fret_share(24, 24)) == (0, 1)
    assert fret_share(12, 24) == pytest.approx(0.5 / 0.75)  # half of the string, of three quarters
    gaps = [fret_share(n + 1, 24) - fret_share(n, 24) for n in range(24)]
    assert all(b / a == pytest.approx(2 ** (-1 / 12)) for a, b in itertools.pairwise(gaps))


def test_a_click_is_the_note_of_its_string_and_fret(qtbot, neck, notes):
    pressed, keys = reported(neck.pressed), []
    for string, fret in ((0, 0), (0, 5), (3, 2), (5, 12), (5, 22)):
        qtbot.mouseClick(neck, LEFT, pos=on(neck, string, fret))
        keys.append(GUITAR[string][1] + fret)
    assert notes == [(what, key) for key in keys for what in ("on", "off")]
    assert all(50 < velocity < 95 for _, velocity, _ in pressed)
    neck.set_range(40, 70)
    qtbot.mouseClick(neck, LEFT, pos=on(neck, 5, 7))
    qtbot.mouseClick(neck, LEFT, pos=NUMBERS)
    assert len(notes) == 10, "beyond the range nothing is played"
    neck.set_range(40, 86)
    for strings in ((("E2", 40),), tuple((str(key), key) for key in range(40, 87, 3)), ()):
        neck.set_strings(strings)
        notes.clear()
        for key in (40, 63, 86):
            qtbot.mouseClick(neck, LEFT, pos=neck.key_rect(key).center().toPoint())
        assert not neck.in_rows and [key for what, key in notes if what == "on"] == [40, 63, 86], "a fan of the keys"


def test_a_velocity_is_shown_before_the_click_and_fast_repeats_are_notes(qtbot, neck, notes):
    at, none = on(neck, 2, 3, 0.9), Qt.MouseButton.NoButton
    pressed = reported(neck.pressed)
    move(neck, at, none)
    shown = neck.figure
    qtbot.mouseClick(neck, LEFT, pos=at)
    qtbot.mouseDClick(neck, LEFT, pos=at)
    qtbot.mouseRelease(neck, LEFT, pos=at)
    assert shown == f"velocity {pressed[0][1]}" and notes == 2 * [("on", 53), ("off", 53)]
    for leave in (lambda: move(neck, NUMBERS, none), lambda: QApplication.sendEvent(neck, QEvent(QEvent.Type.Leave))):
        move(neck, at, none)
        leave()
        assert neck.figure == ""


def test_a_note_is_seen_on_the_highest_string_at_or_below_it(neck):
    keys = (40, 44, 45, 58, 59, 86, 30)
    assert [neck.string_of(key) for key in keys] == [0, 0, 1, 3, 4, 5, 0]
    bare = picture(neck)
    pictures = []
    for note in (SoundingNote(52, 1.0), SoundingNote(52, 1.0, string=5), SoundingNote(52, 1.0, string=5, slid=-4.25)):
        neck.show_notes([note])
        pictures.append(picture(neck))
    assert all(one != other for one, other in itertools.combinations([bare, *pictures], 2))


def test_a_drag_across_strings_strums_each_once_and_lets_all_ring(qtbot, neck, notes):
    pressed, chord = reported(neck.pressed), [42, 47, 52, 57, 61, 66]
    qtbot.mousePress(neck, LEFT, pos=on(neck, 0, 2))
    qtbot.mouseMove(neck, on(neck, 3, 2))  # a fast mouse is seen at few places
    qtbot.mouseMove(neck, on(neck, 5, 2) + QPoint(0, 5))  # lower on its string
    assert notes == [("on", key) for key in chord]
    assert all(neck.is_down(key) for key in chord)
    assert len({velocity for _, velocity, _ in pressed}) == 1, "that of the click"
    qtbot.mouseRelease(neck, LEFT, pos=on(neck, 5, 2))
    assert sorted(notes[6:]) == [("off", key) for key in chord]
    assert not any(neck.is_down(key) for key in chord)
    pressed.clear()
    released = reported(neck.released)
    drag(neck, on(neck, 4, 5), on(neck, 5, 0))
    assert [(key, string) for key, _, string in pressed] == released == [(64, 1), (64, 0)], "of one pitch"


@pytest.mark.parametrize("legato", [False, True])
def test_a_drag_along_a_string_takes_its_note_over_in_legato(neck, notes, legato):
    neck.legato = legato
    drag(neck, on(neck, 0, 1), on(neck, 0, 3))
    moved = [("on", 43), ("off", 41)]
    assert notes == [("on", 41), *(moved if legato else moved[::-1]), ("off", 43)]


@pytest.mark.parametrize(("button", "modifier"), [(RIGHT, NONE), (LEFT, SHIFT)])
def test_a_chord_is_fingered_silently_then_strummed(qtbot, neck, notes, button, modifier):
    bare = picture(neck)
    for string, fret in ((1, 3), (2, 2), (3, 5), (4, 1)):  # C, and a wrong finger on G
        qtbot.mouseClick(neck, button, modifier, on(neck, string, fret))
    qtbot.mouseClick(neck, button, modifier, on(neck, 3, 5))  # lifted
    assert notes == [] and neck.fingers == {1: 3, 2: 2, 4: 1}
    assert picture(neck) != bare
    drag(neck, on(neck, 1, 9), on(neck, 5, 10))  # wherever it is strummed
    assert [key for what, key in notes if what == "on"] == [48, 52, 55, 60, 64]
    press_keys(neck, Key.Key_Delete)
    assert neck.fingers == {}
    qtbot.mouseClick(neck, button, modifier, on(neck, 2, 4))
    neck.set_strings(GUITAR[:4])
    assert neck.fingers == {}, "fingers leave with their strings"


def test_the_keyboard_alone_fingers_a_chord_and_strums_it(qtbot, neck, notes):
    up, down, left, right = Key.Key_Up, Key.Key_Down, Key.Key_Left, Key.Key_Right
    press_keys(neck, *[down] * 9, *[left] * 30, right)
    assert neck.chosen == (41, 5)  # F on the lowest string
    assert neck.accessibleDescription().startswith("F2, string E2, fret 1; ")
    press_keys(neck, Key.Key_Return, held=SHIFT)
    press_keys(neck, up, right, right)
    press_keys(neck, Key.Key_Return, held=SHIFT)
    assert notes == [] and neck.fingers == {0: 1, 1: 3}
    qtbot.keyPress(neck, Key.Key_Return, CONTROL)
    assert notes == [("on", key) for key in (41, 48, 50, 55, 59, 64)]
    qtbot.keyRelease(neck, Key.Key_Return, CONTROL)
    assert [what for what, _ in notes] == ["on"] * 6 + ["off"] * 6


@pytest.fixture
def keys(show: Callable[..., PianoKeys]) -> PianoKeys:
    made = show(PianoKeys(), 1001, 100)
    made.set_range(40, 86)
    return made


@pytest.fixture
def played(keys: PianoKeys) -> Notes:
    return notes_of(keys)


def spot(keys: PianoKeys, key: int, share: float = 0.9) -> QPoint:
    """On a key, so far down."""
    rect = keys.key_rect(key)
    return QPointF(rect.center().x(), rect.top() + share * rect.height()).toPoint()


def test_every_key_is_found_where_it_is_drawn(keys):
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


def test_lower_on_a_key_is_harder(qtbot, keys, played):
    pressed = reported(keys.pressed)
    assert is_black(66)
    for key, share in ((64, 0.0), (64, 0.5), (64, 0.99), (66, 0.97)):
        qtbot.mouseClick(keys, LEFT, pos=spot(keys, key, share))
    softest, middle, *hard = (velocity for _, velocity, *_ in pressed)
    assert (softest, middle) == (SOFTEST, pytest.approx((SOFTEST + HARDEST) / 2, abs=3))
    assert hard == [pytest.approx(HARDEST, abs=3), pytest.approx(HARDEST, abs=8)]
    assert played == [(what, key) for key in (64, 64, 64, 66) for what in ("on", "off")]


def test_a_drag_is_a_glissando(qtbot, keys, played):
    qtbot.mousePress(keys, LEFT, pos=spot(keys, 60))
    for key in (60, 62, 64):
        qtbot.mouseMove(keys, spot(keys, key))
    qtbot.mouseMove(keys, QPoint(keys.width() + 50, 50))  # beside the keys: the last one continues
    qtbot.mouseRelease(keys, LEFT, pos=spot(keys, 64))
    assert played == [("on", 60), ("off", 60), ("on", 62), ("off", 62), ("on", 64), ("off", 64)]


@pytest.mark.parametrize(("button", "modifier"), [(RIGHT, NONE), (LEFT, SHIFT)])
def test_a_key_that_is_held_stays_until_it_is_clicked_so_again(qtbot, keys, played, button, modifier):
    qtbot.mouseClick(keys, button, modifier, spot(keys, 60))
    assert (played, keys.held) == ([("on", 60)], {60})
    qtbot.mouseClick(keys, LEFT, pos=spot(keys, 60))  # plucks it again, and it stays
    assert played == [("on", 60), ("on", 60), ("off", 60)]  # the release of the first stroke
    qtbot.mouseClick(keys, button, modifier, spot(keys, 60))
    assert (played[3:], keys.held) == ([("off", 60)], set())


@pytest.mark.parametrize("end", ["release_all", "another range", "hide"])
def test_each_stroke_is_released_however_it_was_struck(qtbot, keys, played, end):
    qtbot.mouseClick(keys, RIGHT, pos=spot(keys, 60))
    qtbot.mousePress(keys, LEFT, pos=spot(keys, 59))
    for key in (60, 62, 60):  # a glissando over the key that is held
        qtbot.mouseMove(keys, spot(keys, key))
    qtbot.keyPress(keys, Key.Key_Return)
    {"release_all": keys.release_all, "another range": lambda: keys.set_range(28, 60), "hide": keys.hide}[end]()
    for key in (59, 60, 62):
        assert played.count(("on", key)) == played.count(("off", key)) > 0
