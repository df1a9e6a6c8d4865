"""On the neck a click is the note of its string and fret; what sounds is seen on the string that sounds it."""

from __future__ import annotations

import itertools

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from pytestqt.qtbot import QtBot

from app.views import theme
from app.views.instrument.neck import Neck, fret_share

LEFT = Qt.MouseButton.LeftButton
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
    neck.released.connect(released.append)
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
    neck.show_sounding({52: 1.0})  # the second fret of D
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


@pytest.mark.parametrize("levels", [{}, {20: 1.0, 127: 0.5}, {40: 0.2, 64: 2.0}])
def test_whatever_sounds_can_be_painted(neck: Neck, levels: dict[int, float]) -> None:
    for strings in (GUITAR, ()):
        neck.set_strings(strings)
        neck.show_sounding(levels)
        assert not neck.grab().isNull()
