"""The picture of a drum: clicks strike where they point, marks are dragged, and colours show displacement."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QColor
from pytestqt.qtbot import QtBot

from app.session.shown import DEFAULT_SOURCES
from app.views import theme
from app.views.drum.axes import HeadAxes
from app.views.drum.ink import HeadFrame, fitting_scale_m, image_of, kept_scale_m
from app.views.drum.view import DrumView
from tests.app.gestures import CONTROL, LEFT, RIGHT, SHIFT, colour_at, drag, picture, press_keys, reported

Key = Qt.Key


@pytest.fixture
def view(show: Callable[..., DrumView]) -> DrumView:
    made = DrumView()
    made.set_drum("Tom, A2", "circle", (0.33, 0.33))
    made.set_plain(True)
    made.set_sources(DEFAULT_SOURCES[:1])
    return show(made, 900, 320)


@pytest.mark.parametrize("shape", ["circle", "rectangle", "bar"])
@pytest.mark.parametrize("heads", [1, 2])
def test_places_lead_to_pixels_and_back(shape: str, heads: int) -> None:
    axes = HeadAxes(900, 320, shape, (0.4, 0.2), heads)  # type: ignore[arg-type]
    for head in range(heads):
        for place in ((0.0, 0.0), (0.5, -0.3), (-0.6, 0.7)):
            assert axes.place(axes.at(head, place)) == pytest.approx(place)
        area = axes.rect(head)
        assert area.left() >= 0 and area.right() <= 900
        assert area.height() / area.width() == pytest.approx(0.5)
    assert axes.place(QPointF(2, 2)) is None
    corner = axes.place(axes.at(0, (0.9, 0.9)))
    assert (corner is None) == (shape == "circle")


def test_a_click_strikes_there_and_with_shift_hard(qtbot: QtBot, view: DrumView) -> None:
    struck = reported(view.struck)
    at = view.axes.at(0, (0.4, -0.5)).toPoint()
    qtbot.mouseClick(view, LEFT, pos=at)
    qtbot.mouseClick(view, LEFT, SHIFT, pos=at)
    qtbot.mouseDClick(view, LEFT, pos=at)
    qtbot.mouseClick(view, LEFT, pos=QPoint(3, 3))
    qtbot.mouseClick(view, RIGHT, pos=at)
    near = (pytest.approx(0.4, abs=0.01), pytest.approx(-0.5, abs=0.01))
    assert struck == [(*near, False), (*near, True), (*near, False)]


def test_a_mark_is_dragged_and_reset(qtbot: QtBot, view: DrumView) -> None:
    view.set_listening_points(0.3, 0.8)
    moved, reset = reported(view.listening_point_moved), reported(view.listening_point_reset)
    struck, axes = reported(view.struck), view.axes
    foot = round(axes.bottom) + 8
    places = [QPoint(x, foot) for x in (round(axes.x(0.8)), round(axes.x(0.6)), 5_000)]
    drag(view, *places)
    assert moved == [("right", pytest.approx(0.6, abs=0.01)), ("right", 1.0)]
    cursors = set()
    for at in (places[0], axes.at(0, (0.4, -0.5)).toPoint(), QPoint(3, 3)):
        qtbot.mouseMove(view, at)
        cursors.add(view.cursor().shape())
    assert len(cursors) == 3, "the pointer shows what a press would do"
    qtbot.mouseDClick(view, LEFT, pos=QPoint(round(axes.x(0.3)), foot))
    assert (reset, struck) == (["left"], [])


def test_keys_move_the_place_the_mark_and_reset_them(view: DrumView) -> None:
    places, marks = reported(view.place_moved), reported(view.listening_point_moved)
    resets = reported(view.place_reset, view.listening_point_reset)
    view.place_moved.connect(lambda *to: view.set_place(to))
    view.set_listening_points(0.5, 0.7)
    press_keys(view, Key.Key_Right, Key.Key_Up, Key.Key_Left, Key.Key_Down)
    assert places == [pytest.approx(to) for to in ((0.05, 0.0), (0.05, 0.05), (0.0, 0.05), (0.0, 0.0))]
    press_keys(view, Key.Key_Right, held=SHIFT)
    press_keys(view, Key.Key_Left, held=SHIFT | CONTROL)
    assert marks == [("left", pytest.approx(0.51)), ("right", pytest.approx(0.69))]
    press_keys(view, Key.Key_Delete)
    press_keys(view, Key.Key_Delete, held=SHIFT)
    assert resets == [(), "left", "right"]
    view.set_place((0.97, 0.0))
    press_keys(view, Key.Key_Right)
    assert len(places) == 4, "the rim is not struck"


def test_up_is_amber_down_is_blue_and_rest_is_the_panel(view: DrumView) -> None:
    columns = np.broadcast_to(np.linspace(-1, 1, 57), (57, 57))
    for up in (1, -1):
        view.show_frame(HeadFrame({"model": (1e-3 * up * columns).astype(np.float32)}))
        image = picture(view)
        amber, blue, middle = (colour_at(image, view.axes.at(0, (x, 0.4))) for x in (0.8 * up, -0.8 * up, 0.0))
        assert amber.red() > amber.blue() + 60
        assert blue.blue() > blue.red() + 60
        panel = QColor(theme.PANEL)
        assert max(abs(middle.red() - panel.red()), abs(middle.blue() - panel.blue())) < 30
    view.show_frame(None)
    assert colour_at(picture(view), view.axes.at(0, (0.8, 0.4))) == panel
    view.set_sources(DEFAULT_SOURCES)  # a picture each
    up, down = np.full((57, 57), 1e-3, np.float32), np.full((57, 57), -1e-6, np.float32)
    view.show_frame(HeadFrame({"model": up, "truth": down}))
    first, second = (colour_at(picture(view), view.axes.at(head, (0.5, 0.3))) for head in (0, 1))
    assert first.red() > first.blue() and second.blue() > second.red(), "each has a scale of its own"


def test_scales_are_round_and_stay_while_they_fit_and_colours_end_there() -> None:
    for largest, scale in ((0.8e-3, 1e-3), (1e-3, 1e-3), (1.1e-3, 1.5e-3), (8e-9, 1e-8)):
        assert fitting_scale_m(largest) == pytest.approx(scale)
    for largest, scale in ((1.2e-3, 2e-3), (0.9e-3, 1.5e-3), (4e-3, 5e-3)):
        assert kept_scale_m(largest, 2e-3) == pytest.approx(scale)
    image = image_of(np.array([[-3.0, -1.0, 0.0, 1.0, 3.0]], np.float32) * 1e-3, 1e-3)
    colours = [image.pixelColor(column, 0).name() for column in range(5)]
    assert colours[0] == colours[1] != colours[3] == colours[4]
    assert colours[2] == theme.PANEL
