"""On the neck a click is the note of its string and fret; what sounds is seen on the string that sounds it."""

from __future__ import annotations

import itertools

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from pytestqt.qtbot import QtBot

from app.playing.keys import SoundingNote
from app.views import theme
from app.views.instrument.neck import Neck, fret_share

LEFT, RIGHT = Qt.MouseButton.LeftButton, Qt.MouseButton.RightButton
SHIFT = Qt.KeyboardModifier.ShiftModifier
GUITAR = (("E2", 40), ("A2", 45), ("D3", 50), ("G3", 55), ("B3", 59), ("E4", 64))


@pytest.fixture
def neck(qtbot: QtBot) -> Neck:
    made = Neck()
    qtbot.addWidget(made)
    made.resize(1000, 110)
    made.set_strings(GUITAR)
    made.set_range(40, 86)
    made.show()
    return made


def on(neck: Neck, string: int, fret: int, share: float = 0.5) -> QPoint:
    cell = neck.cell(string, fret)
    return QPointF(cell.center().x(), cell.top() + share * cell.height()).toPoint()


def test_frets_lie_where_those_of_a_string_do() -> None:
    assert fret_share(0, 24) == 0
    assert fret_share(24, 24) == 1
    assert fret_share(12, 24) == pytest.approx(0.5 / 0.75)  # half of the string, of three quarters
    gaps = [fret_share(n + 1, 24) - fret_share(n, 24) for n in range(24)]
    assert all(b / a == pytest.approx(2 ** (-1 / 12)) for a, b in itertools.pairwise(gaps))


def test_a_click_is_the_note_of_its_string_and_fret(qtbot: QtBot, neck: Neck) -> None:
    pressed: list[tuple[int, int]] = []
    released: list[int] = []
    neck.pressed.connect(lambda key, velocity: pressed.append((key, velocity)))
    neck.released.connect(lambda key: released.append(key))
    for string, fret in ((0, 0), (0, 5), (3, 2), (5, 12), (5, 22)):
        qtbot.mouseClick(neck, LEFT, pos=on(neck, string, fret))
        assert pressed[-1][0] == GUITAR[string][1] + fret
    assert released == [key for key, _ in pressed]
    assert all(50 < velocity < 95 for _, velocity in pressed)


def test_the_highest_string_is_above_and_lower_in_a_row_is_harder(qtbot: QtBot, neck: Neck) -> None:
    assert neck.cell(5, 3).top() == 0 < neck.cell(0, 3).top()
    velocities: list[int] = []
    neck.pressed.connect(lambda _, velocity: velocities.append(velocity))
    for share in (0.15, 0.85):
        qtbot.mouseClick(neck, LEFT, pos=on(neck, 2, 3, share))
    assert velocities[0] + 40 < velocities[1]


def test_a_note_is_seen_on_the_highest_string_at_or_below_it(neck: Neck) -> None:
    for key, string in ((40, 0), (44, 0), (45, 1), (58, 3), (59, 4), (86, 5), (30, 0)):
        assert neck.string_of(key) == string
    neck.show_notes([SoundingNote(52, 1.0)])  # the second fret of D
    picture = neck.grab().toImage()
    ratio = picture.devicePixelRatio()
    rect = neck.cell(2, 2)
    seen = {
        picture.pixelColor(round(x * ratio), round(rect.center().y() * ratio)).name()
        for x in range(int(rect.left()), int(rect.right()))
    }
    assert theme.MODEL in seen


@pytest.mark.parametrize("strings", [(("E2", 40),), tuple((str(key), key) for key in range(40, 87, 3)), ()])
def test_many_strings_or_one_are_a_fan_of_the_keys(
    qtbot: QtBot, neck: Neck, strings: tuple[tuple[str, int], ...]
) -> None:
    neck.set_strings(strings)
    assert not neck.in_rows
    pressed: list[int] = []
    neck.pressed.connect(lambda key, _: pressed.append(key))
    for key in (40, 63, 86):
        qtbot.mouseClick(neck, LEFT, pos=neck.key_rect(key).center().toPoint())
    assert pressed == [40, 63, 86]


def test_beyond_the_range_nothing_is_played(qtbot: QtBot, neck: Neck) -> None:
    neck.set_range(40, 70)
    pressed: list[int] = []
    neck.pressed.connect(lambda key, _: pressed.append(key))
    qtbot.mouseClick(neck, LEFT, pos=on(neck, 5, 7))
    qtbot.mouseClick(neck, LEFT, pos=QPoint(500, 108))  # the numbers beneath
    assert pressed == []


def test_the_velocity_of_a_click_is_shown(qtbot: QtBot, neck: Neck) -> None:
    heard: list[int] = []
    neck.pressed.connect(lambda _, velocity: heard.append(velocity))
    assert neck.figure == ""
    for share in (0.2, 0.8):
        before = neck.grab().toImage()
        qtbot.mouseMove(neck, on(neck, 2, 4, share))
        hovered = neck.figure
        assert neck.grab().toImage() != before
        qtbot.mousePress(neck, LEFT, pos=on(neck, 2, 4, share))
        assert neck.figure == hovered == f"velocity {heard[-1]}"
        qtbot.mouseMove(neck, on(neck, 3, 4, 0.5))  # a strum keeps it
        assert neck.figure == hovered
        qtbot.mouseRelease(neck, LEFT, pos=on(neck, 3, 4, 0.5))
    qtbot.mouseMove(neck, QPoint(500, 108))  # the numbers beneath
    assert neck.figure == ""


def test_the_string_at_the_cursor_is_named(qtbot: QtBot, neck: Neck) -> None:
    qtbot.mouseClick(neck, LEFT, pos=on(neck, 1, 3))
    assert neck.accessibleDescription().startswith("C3, string A2, fret 3; ")
    qtbot.keyClick(neck, Qt.Key.Key_Up)
    assert neck.accessibleDescription().startswith("F3, string D3, fret 3; ")
    assert "velocity 96" in neck.accessibleDescription()


@pytest.mark.parametrize("levels", [{}, {20: 1.0, 127: 0.5}, {40: 0.2, 64: 2.0}])
def test_whatever_sounds_can_be_painted(neck: Neck, levels: dict[int, float]) -> None:
    for strings in (GUITAR, ()):
        neck.set_strings(strings)
        neck.show_sounding(levels)
        neck.show_notes([SoundingNote(key, level, key % 7 - 1, 0.3) for key, level in levels.items()])
        assert not neck.grab().isNull()


def lit_x(neck: Neck, string: int) -> float:
    """Where the dot of a string begins: the share of the width left of it."""
    picture = neck.grab().toImage()
    y = round(neck.cell(string, 0).center().y() * picture.devicePixelRatio())
    lit = [x for x in range(picture.width()) if picture.pixelColor(x, y).name() == theme.MODEL]
    return lit[0] / picture.width() if lit else float("nan")


def test_a_note_that_slides_is_seen_on_its_own_string_between_two_frets(neck: Neck) -> None:
    neck.show_notes([SoundingNote(52, 1.0, string=5)])  # slid up the lowest string, far above the open D
    last = lit_x(neck, 0)
    assert last > 0 and lit_x(neck, 2) != lit_x(neck, 2)
    on_the_way = []
    for slid in (-12.0, -8.5, -4.25, -1.5):
        neck.show_notes([SoundingNote(52, 1.0, string=5, slid=slid)])
        on_the_way.append(lit_x(neck, 0))
    assert on_the_way == sorted(on_the_way) and on_the_way[-1] < last


def test_a_drag_across_strings_strums_each_once_and_lets_all_ring(qtbot: QtBot, neck: Neck) -> None:
    heard: list[tuple[str, int]] = []
    velocities = set[int]()
    neck.pressed.connect(lambda key, _: heard.append(("on", key)))
    neck.pressed.connect(lambda _, velocity: velocities.add(velocity))
    neck.released.connect(lambda key: heard.append(("off", key)))
    qtbot.mousePress(neck, LEFT, pos=on(neck, 0, 2))
    qtbot.mouseMove(neck, on(neck, 3, 2))  # a fast mouse is seen at few places
    qtbot.mouseMove(neck, on(neck, 5, 2) + QPoint(0, 5))  # lower on its string
    assert heard == [("on", key) for key in (42, 47, 52, 57, 61, 66)]
    assert all(neck.is_down(key) for _, key in heard)
    assert len(velocities) == 1  # that of the click
    qtbot.mouseRelease(neck, LEFT, pos=on(neck, 5, 2))
    assert {key for what, key in heard if what == "off"} == {42, 47, 52, 57, 61, 66}
    assert not any(neck.is_down(key) for _, key in heard)


@pytest.mark.parametrize("legato", [False, True])
def test_a_drag_along_a_string_takes_its_note_over_where_keys_are_legato(
    qtbot: QtBot, neck: Neck, legato: bool
) -> None:
    heard: list[tuple[str, int]] = []
    neck.legato = legato
    neck.pressed.connect(lambda key, _: heard.append(("on", key)))
    neck.released.connect(lambda key: heard.append(("off", key)))
    qtbot.mousePress(neck, LEFT, pos=on(neck, 0, 1))
    qtbot.mouseMove(neck, on(neck, 0, 3))
    qtbot.mouseRelease(neck, LEFT, pos=on(neck, 0, 3))
    moved = [("on", 43), ("off", 41)]
    assert heard == [("on", 41), *(moved if legato else moved[::-1]), ("off", 43)]


def test_a_click_gives_its_string_and_two_strings_have_one_pitch(qtbot: QtBot, neck: Neck) -> None:
    heard: list[tuple[str, int, int]] = []
    neck.pressed.connect(lambda key, _, string: heard.append(("on", key, string)))
    neck.released.connect(lambda key, string: heard.append(("off", key, string)))
    qtbot.mousePress(neck, LEFT, pos=on(neck, 4, 5))
    qtbot.mouseMove(neck, on(neck, 5, 0))
    qtbot.mouseRelease(neck, LEFT, pos=on(neck, 5, 0))
    assert heard == [("on", 64, 1), ("on", 64, 0), ("off", 64, 1), ("off", 64, 0)]


@pytest.mark.parametrize(("button", "modifier"), [(RIGHT, Qt.KeyboardModifier.NoModifier), (LEFT, SHIFT)])
def test_a_chord_is_fingered_silently_then_strummed(
    qtbot: QtBot, neck: Neck, button: Qt.MouseButton, modifier: Qt.KeyboardModifier
) -> None:
    heard: list[int] = []
    neck.pressed.connect(lambda key, _: heard.append(key))
    for string, fret in ((1, 3), (2, 2), (3, 5), (4, 1)):  # C, and a wrong finger on G
        qtbot.mouseClick(neck, button, modifier, on(neck, string, fret))
    qtbot.mouseClick(neck, button, modifier, on(neck, 3, 5))  # lifted
    assert heard == [] and neck.fingers == {1: 3, 2: 2, 4: 1}
    qtbot.mousePress(neck, LEFT, pos=on(neck, 1, 9))  # wherever it is strummed
    qtbot.mouseMove(neck, on(neck, 5, 10))
    qtbot.mouseRelease(neck, LEFT, pos=on(neck, 5, 10))
    assert heard == [48, 52, 55, 60, 64]
    neck.setFocus()
    qtbot.keyClick(neck, Qt.Key.Key_Delete)
    assert neck.fingers == {}
    qtbot.mouseClick(neck, LEFT, pos=on(neck, 1, 9))
    assert heard[-1] == 54


def test_fingers_are_seen_and_leave_with_their_strings(qtbot: QtBot, neck: Neck) -> None:
    bare = neck.grab().toImage()
    qtbot.mouseClick(neck, RIGHT, pos=on(neck, 2, 4))
    assert neck.grab().toImage() != bare
    neck.set_strings(GUITAR[:4])
    assert neck.fingers == {}


def test_the_keyboard_alone_fingers_a_chord_and_strums_it(qtbot: QtBot, neck: Neck) -> None:
    heard: list[tuple[str, int, int]] = []
    neck.pressed.connect(lambda key, _, string: heard.append(("on", key, string)))
    neck.released.connect(lambda key, string: heard.append(("off", key, string)))
    up, down, left, right = Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_Left, Qt.Key.Key_Right
    for arrow in [down] * 9 + [left] * 30 + [right]:
        qtbot.keyClick(neck, arrow)
    assert neck.chosen == (41, 5)  # F on the lowest string
    qtbot.keyClick(neck, Qt.Key.Key_Return, SHIFT)
    for arrow in (up, right, right):
        qtbot.keyClick(neck, arrow)
    qtbot.keyClick(neck, Qt.Key.Key_Return, SHIFT)
    assert heard == [] and neck.fingers == {0: 1, 1: 3}
    qtbot.keyClick(neck, Qt.Key.Key_Return)
    assert heard == [("on", 48, 4), ("off", 48, 4)]
    heard.clear()
    qtbot.keyPress(neck, Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    assert heard == [("on", key, 5 - string) for string, key in enumerate((41, 48, 50, 55, 59, 64))]
    qtbot.keyRelease(neck, Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    assert [what for what, _, _ in heard] == ["on"] * 6 + ["off"] * 6
    qtbot.keyClick(neck, up)
    qtbot.keyClick(neck, up)
    assert neck.chosen == (58, 2), "the same fret of another string"


def test_the_cursor_on_the_neck_is_seen_on_its_string(
    qtbot: QtBot, neck: Neck, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(neck, "hasFocus", lambda: True)  # a window without a desktop is never active
    seen = []
    for arrow in (Qt.Key.Key_Down, Qt.Key.Key_Down, Qt.Key.Key_Right, Qt.Key.Key_Left):
        qtbot.keyClick(neck, arrow)
        seen.append(neck.grab().toImage())
    assert seen[0] != seen[1] != seen[2] and seen[3] == seen[1]
