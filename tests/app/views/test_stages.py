"""Gestures on the string and on a drum, and their pictures, in which all can be read."""

from collections.abc import Callable

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QColor

from app.session.shown import DEFAULT_SOURCES
from app.views import theme
from app.views.drum.axes import HeadAxes
from app.views.drum.ink import HeadFrame, fitting_scale_m, image_of, kept_scale_m
from app.views.drum.view import DrumView
from app.views.string.axes import StringAxes
from app.views.string.ground import TrainedPlucks
from app.views.string.ink import ShownPluck
from app.views.string.view import StringView
from tests.app.gestures import (
    CONTROL,
    LEFT,
    NONE,
    RIGHT,
    SHIFT,
    colour_at,
    drag,
    move,
    picture,
    press_keys,
    reported,
    turn_wheel,
)

WIDTH, HEIGHT = 900, 300
AXES = StringAxes(WIDTH, HEIGHT, 5.0)  # of a pluck of 4 mm
HANDLE = AXES.at(0.5, 4.0).toPoint()
FOOT = int(AXES.bottom) + 8
Key = Qt.Key


@pytest.fixture
def view(show: Callable[..., StringView]) -> StringView:
    """A string plucked at 0.5 by 4 mm that follows what is asked of it."""
    made = show(StringView(), WIDTH, HEIGHT)
    made.set_listening_points(0.37)
    made.pluck_drawn.connect(lambda position, mm: made.set_pluck(ShownPluck(position, mm, np.zeros(101))))
    made.pluck_drawn.emit(0.5, 4.0)
    made.grab()
    return made


@pytest.fixture
def plucks(view: StringView) -> list[tuple[float, float]]:
    return reported(view.pluck_drawn)


def test_axes_go_to_pixels_and_back():
    assert AXES.position(AXES.x(0.3)) == pytest.approx(0.3)
    assert AXES.displacement_mm(AXES.y(-2.5)) == pytest.approx(-2.5)
    curve = AXES.curve(np.array([0.0, 5.0, 0.0])).toList()
    places = [(AXES.x(0), AXES.middle), (AXES.x(0.5), AXES.top), (AXES.x(1), AXES.middle)]
    assert [(point.x(), point.y()) for point in curve] == places
    outlines = AXES.band(np.array([-1.0, -2.0]), np.array([1.0, 2.0]))
    heights = [[round(AXES.displacement_mm(p.y()), 6) for p in outline.toList()] for outline in outlines]
    assert heights == [[-1, -2, 2, 1], [-1, -2], [1, 2]]


def test_the_pointer_is_over_what_it_can_grab_and_shows_a_whole_warning(view):
    view.set_warning("Outside the training range")
    foot, shapes = QPoint(round(AXES.x(0.37)), FOOT), Qt.CursorShape
    for at, cursor, tip in (
        (HANDLE, shapes.OpenHandCursor, "Drag along the string for the position"),
        (foot, shapes.SizeHorCursor, "Drag to hear the string from another point"),
        (QPoint(300, 5), shapes.CrossCursor, "Outside the training range"),
    ):
        move(view, at, Qt.MouseButton.NoButton)
        assert view.cursor().shape() == cursor and view.toolTip().startswith(tip)


def test_the_handle_is_dragged_without_a_jump(view, plucks):
    drags = reported(view.drag_started, view.drag_ended, view.pluck_released)
    grip = HANDLE + QPoint(5, 4)
    drag(view, grip, grip + QPoint(80, 0))
    assert plucks == [(pytest.approx(0.5 + 80 / AXES.length), pytest.approx(4.0))]
    assert len(drags) == 3
    view.pluck_drawn.emit(0.5, 4.0)
    drag(view, *(HANDLE - QPoint(0, 5 * step) for step in range(13)))
    grown = np.diff([mm for _, mm in plucks[1:]])  # the scale steps up under the pointer
    assert ((grown >= 0) & (grown < 1.0)).all() and (grown[1:] > 0).all() and plucks[-1][1] > 5


@pytest.mark.parametrize("mm", [4.0, 0.2])  # the latter is the knob's doing
def test_a_click_plucks_as_far_as_the_last_time_and_a_drag_sets_it(view, plucks, mm):
    released = reported(view.pluck_released)
    view.pluck_drawn.emit(0.5, mm)
    x = round(AXES.x(0.3))
    at = QPoint(x, round(AXES.middle) - 1)
    drag(view, at, at + QPoint(1, -2))
    assert plucks[-1] == (pytest.approx(0.3, abs=0.003), mm)
    assert len(released) == 1
    view.pluck_drawn.emit(0.5, 4.0)
    plucks.clear()
    drag(
        view, *(QPoint(x + by, round(AXES.y(to))) for by, to in ((0, 2.0), (40, 3.0), (40, -2.0), (40, 0.1), (40, 0)))
    )
    assert [to for _, to in plucks[1:]] == pytest.approx([3.0, 2.0, 0.5, 0.5], abs=0.05)


def test_the_wheel_over_the_handle_sets_width_and_with_shift_the_shape(view):
    steps = reported(view.width_stepped, view.shape_stepped)
    for at, turned, held, taken in (
        (HANDLE, 120, NONE, True),
        (HANDLE, -60, SHIFT, True),
        (HANDLE, -60, SHIFT, True),
        (QPoint(100, 200), 120, NONE, False),
    ):
        assert turn_wheel(view, at, QPoint(0, turned), held) == taken
    assert steps == [1.0, -1]


def test_a_double_click_resets_only_what_was_clicked_at_rest(qtbot, view):
    resets, released = reported(view.pluck_reset), reported(view.pluck_released)
    for at, seen in ((QPoint(200, 100), (0, 2)), (HANDLE, (1, 3))):
        view.pluck_drawn.emit(0.5, 4.0)
        qtbot.wait(0 if at != HANDLE else 450)  # longer than between two clicks
        qtbot.mouseClick(view, LEFT, pos=at)
        qtbot.mouseDClick(view, LEFT, pos=at)
        qtbot.mouseRelease(view, LEFT, pos=at)
        assert (len(resets), len(released)) == seen, "the first click brings the handle there: twice plucked"


def test_two_markers_are_reported_apart_and_reset_and_the_bridge_has_none(qtbot, view):
    moved, resets = reported(view.listening_point_moved), reported(view.listening_point_reset)
    for points in ((0.2, 0.6), (None, None)):
        view.set_listening_points(*points)
        for position in (0.2, 0.6):
            at = QPoint(round(AXES.x(position)), FOOT)
            drag(view, at, at + QPoint(20, 0))
    qtbot.keyClick(view, Key.Key_Left, SHIFT)
    by = 20 / AXES.length
    assert moved == [("left", pytest.approx(0.2 + by, abs=0.001)), ("right", pytest.approx(0.6 + by, abs=0.001))]
    view.set_listening_points(0.2, 0.6)
    qtbot.mouseDClick(view, LEFT, pos=QPoint(round(AXES.x(0.6)), FOOT))
    assert resets == ["right"]


def test_everything_by_keyboard(view):
    view.set_listening_points(0.37, 0.7)
    for key, held, signal, values in (
        (Key.Key_Right, NONE, view.pluck_drawn, (pytest.approx(0.51), 4.0)),
        (Key.Key_Down, NONE, view.pluck_drawn, (0.5, 3.5)),
        (Key.Key_Up, SHIFT, view.pluck_drawn, (0.5, pytest.approx(4.05))),
        (Key.Key_Left, SHIFT, view.listening_point_moved, ("left", pytest.approx(0.36))),
        (Key.Key_Right, SHIFT | CONTROL, view.listening_point_moved, ("right", pytest.approx(0.71))),
        (Key.Key_Up, CONTROL, view.width_stepped, 1.0),
        (Key.Key_Left, CONTROL, view.shape_stepped, -1),
        (Key.Key_Delete, NONE, view.pluck_reset, ()),
        (Key.Key_Delete, SHIFT, view.listening_point_reset, "left"),
    ):
        view.pluck_drawn.emit(0.5, 4.0)
        seen = reported(signal)
        press_keys(view, key, held=held)
        assert seen[0] == values, (key, held)


def test_what_was_not_trained_is_shaded(view):
    plain = picture(view)
    view.set_trained(TrainedPlucks((0.3, 0.7), (1.0, 2.0)))
    shaded = picture(view)
    for position, mm in ((0.1, 3.0), (0.9, -3.0), (0.4, 3.0), (0.4, 0.5)):
        at = AXES.at(position, mm).toPoint()
        near = [at + QPoint(i, 0) for i in range(8)]
        assert any(shaded.pixel(each) != plain.pixel(each) for each in near), (position, mm)
    inside = AXES.at(0.42, 1.5).toPoint()
    assert shaded.pixel(inside) == plain.pixel(inside)


@pytest.fixture
def drum(show: Callable[..., DrumView]) -> DrumView:
    made = DrumView()
    made.set_drum("Tom, A2", "circle", (0.33, 0.33))
    made.set_plain(True)
    made.set_sources(DEFAULT_SOURCES[:1])
    return show(made, 900, 320)


@pytest.mark.parametrize("shape", ["circle", "rectangle", "bar"])
@pytest.mark.parametrize("heads", [1, 2])
def test_places_lead_to_pixels_and_back(shape, heads):
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


def test_a_click_strikes_there_and_with_shift_hard(qtbot, drum):
    struck = reported(drum.struck)
    at = drum.axes.at(0, (0.4, -0.5)).toPoint()
    qtbot.mouseClick(drum, LEFT, pos=at)
    qtbot.mouseClick(drum, LEFT, SHIFT, pos=at)
    qtbot.mouseDClick(drum, LEFT, pos=at)
    qtbot.mouseClick(drum, LEFT, pos=QPoint(3, 3))
    qtbot.mouseClick(drum, RIGHT, pos=at)
    near = (pytest.approx(0.4, abs=0.01), pytest.approx(-0.5, abs=0.01))
    assert struck == [(*near, False), (*near, True), (*near, False)]


def test_a_mark_is_dragged_and_reset(qtbot, drum):
    drum.set_listening_points(0.3, 0.8)
    moved, reset = reported(drum.listening_point_moved), reported(drum.listening_point_reset)
    struck, axes = reported(drum.struck), drum.axes
    foot = round(axes.bottom) + 8
    drag(drum, *(QPoint(x, foot) for x in (round(axes.x(0.8)), round(axes.x(0.6)), 5_000)))
    assert moved == [("right", pytest.approx(0.6, abs=0.01)), ("right", 1.0)]
    qtbot.mouseDClick(drum, LEFT, pos=QPoint(round(axes.x(0.3)), foot))
    assert (reset, struck) == (["left"], [])


def test_keys_move_the_place_the_mark_and_reset_them(drum):
    places, marks = reported(drum.place_moved), reported(drum.listening_point_moved)
    resets = reported(drum.place_reset, drum.listening_point_reset)
    drum.place_moved.connect(lambda *to: drum.set_place(to))
    drum.set_listening_points(0.5, 0.7)
    press_keys(drum, Key.Key_Right, Key.Key_Up, Key.Key_Left, Key.Key_Down)
    assert places == [pytest.approx(to) for to in ((0.05, 0.0), (0.05, 0.05), (0.0, 0.05), (0.0, 0.0))]
    press_keys(drum, Key.Key_Right, held=SHIFT)
    press_keys(drum, Key.Key_Left, held=SHIFT | CONTROL)
    assert marks == [("left", pytest.approx(0.51)), ("right", pytest.approx(0.69))]
    press_keys(drum, Key.Key_Delete)
    press_keys(drum, Key.Key_Delete, held=SHIFT)
    assert resets == [(), "left", "right"]
    drum.set_place((0.97, 0.0))
    press_keys(drum, Key.Key_Right)
    assert len(places) == 4, "the rim is not struck"


def test_up_is_amber_down_is_blue_and_rest_is_the_panel(drum):
    columns = np.broadcast_to(np.linspace(-1, 1, 57), (57, 57))
    for up in (1, -1):
        drum.show_frame(HeadFrame({"model": (1e-3 * up * columns).astype(np.float32)}))
        image = picture(drum)
        amber, blue = (colour_at(image, drum.axes.at(0, (x, 0.4))) for x in (0.8 * up, -0.8 * up))
        assert amber.red() > amber.blue() + 60
        assert blue.blue() > blue.red() + 60
    drum.show_frame(None)
    assert colour_at(picture(drum), drum.axes.at(0, (0.8, 0.4))) == QColor(theme.PANEL)
    drum.set_sources(DEFAULT_SOURCES)  # a picture each
    up, down = np.full((57, 57), 1e-3, np.float32), np.full((57, 57), -1e-6, np.float32)
    drum.show_frame(HeadFrame({"model": up, "truth": down}))
    first, second = (colour_at(picture(drum), drum.axes.at(head, (0.5, 0.3))) for head in (0, 1))
    assert first.red() > first.blue() and second.blue() > second.red(), "each has a scale of its own"


def test_scales_are_round_and_stay_while_they_fit_and_colours_end_there():
    for largest, top in ((0.8e-3, 1e-3), (1e-3, 1e-3), (1.1e-3, 1.5e-3), (8e-9, 1e-8)):
        assert fitting_scale_m(largest) == pytest.approx(top)
    for largest, top in ((1.2e-3, 2e-3), (0.9e-3, 1.5e-3), (4e-3, 5e-3)):
        assert kept_scale_m(largest, 2e-3) == pytest.approx(top)
    image = image_of(np.array([[-3.0, -1.0, 0.0, 1.0, 3.0]], np.float32) * 1e-3, 1e-3)
    colours = [image.pixelColor(column, 0).name() for column in range(5)]
    assert colours[0] == colours[1] != colours[3] == colours[4]
    assert colours[2] == theme.PANEL
