"""Gestures on the string, and that its input is shown."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QObject, QPoint, QPointF, QRect, Qt
from PySide6.QtGui import QImage, QPaintEvent, QWheelEvent
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.analysis.moment import StringFrame
from app.views.string.axes import StringAxes
from app.views.string.ground import TrainedPlucks
from app.views.string.ink import ShownPluck
from app.views.string.view import StringView

LEFT = Qt.MouseButton.LeftButton
SHIFT, CONTROL = Qt.KeyboardModifier.ShiftModifier, Qt.KeyboardModifier.ControlModifier
NONE = Qt.KeyboardModifier.NoModifier


@pytest.fixture
def view(qtbot: QtBot) -> StringView:
    """A string plucked at 0.5 by 4 mm that follows what is asked of it."""
    made = StringView()
    qtbot.addWidget(made)
    made.resize(900, 300)
    made.show()
    made.set_listening_points(0.37)
    made.pluck_drawn.connect(lambda position, mm: made.set_pluck(ShownPluck(position, mm, np.zeros(101))))
    made.pluck_drawn.emit(0.5, 4.0)
    made.grab()
    return made


def handle(view: StringView) -> QPoint:
    return view._handle(view._axes()).toPoint()


def wheel(view: StringView, at: QPoint, delta: int, modifiers: Qt.KeyboardModifier = NONE) -> bool:
    event = QWheelEvent(
        QPointF(at), QPointF(at), QPoint(), QPoint(0, delta), Qt.MouseButton.NoButton, modifiers,
        Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(view, event)
    return event.isAccepted()


def recorded(signal: object) -> list[tuple[object, ...]]:
    seen: list[tuple[object, ...]] = []
    signal.connect(lambda *values: seen.append(values))  # type: ignore[attr-defined]
    return seen


def test_a_moment_paints_the_string_alone_and_another_scale_all(qtbot: QtBot, view: StringView) -> None:
    """The numbers of the scale reach beyond the string: halves of old ones would be left."""
    painted: list[QRect] = []

    class Painted(QObject):
        def eventFilter(self, watched: QObject, event: QEvent) -> bool:
            if isinstance(event, QPaintEvent):
                painted.append(event.rect())
            return False

    def show(mm: float) -> QRect:
        shape = {"model": np.full(101, mm, np.float32)}
        painted.clear()
        view.show_frame(StringFrame(shape, shape, shape))
        qtbot.waitUntil(lambda: bool(painted))
        return painted[-1]

    watch = Painted(view)
    view.installEventFilter(watch)
    show(4.0)
    assert show(3.9).bottom() <= view._axes().bottom
    assert show(0.3) == view.rect()
    assert show(0.29).bottom() <= view._axes().bottom


def test_axes_go_to_pixels_and_back() -> None:
    axes = StringAxes(900, 300, 5.0)
    assert axes.position(axes.x(0.3)) == pytest.approx(0.3)
    assert axes.displacement_mm(axes.y(-2.5)) == pytest.approx(-2.5)
    curve = axes.curve(np.array([0.0, 5.0, 0.0])).toList()
    assert [(p.x(), p.y()) for p in curve] == [
        (axes.x(0), axes.middle),
        (axes.x(0.5), axes.top),
        (axes.x(1), axes.middle),
    ]
    outlines = axes.band(np.array([-1.0, -2.0]), np.array([1.0, 2.0]))
    heights = [[round(axes.displacement_mm(p.y()), 6) for p in outline.toList()] for outline in outlines]
    assert heights == [[-1, -2, 2, 1], [-1, -2], [1, 2]]


def test_the_handle_is_dragged_without_a_jump_and_shift_is_finer(qtbot: QtBot, view: StringView) -> None:
    started, ended, released = recorded(view.drag_started), recorded(view.drag_ended), recorded(view.pluck_released)
    grip = handle(view) + QPoint(5, 4)
    qtbot.mousePress(view, LEFT, pos=grip)
    assert (view._pluck.position, view._pluck.amplitude_mm) == (0.5, 4.0)
    qtbot.mouseMove(view, grip + QPoint(80, 0))
    moved = view._pluck.position - 0.5
    assert moved == pytest.approx(80 / view._axes().length)
    assert view._pluck.amplitude_mm == pytest.approx(4.0)
    qtbot.mouseRelease(view, LEFT, pos=grip + QPoint(80, 0))
    assert (len(started), len(ended), len(released)) == (1, 1, 1)


def test_a_click_plucks_there_as_far_as_the_last_time(qtbot: QtBot, view: StringView) -> None:
    """On the string's own line too, where the pointer gives next to no amplitude; and a hand is not still."""
    axes, released = view._axes(), recorded(view.pluck_released)
    for mm in (4.0, 0.2):  # the latter is the knob's doing
        view.pluck_drawn.emit(0.5, mm)
        at = QPoint(round(axes.x(0.3)), round(axes.middle) - 1)
        qtbot.mousePress(view, LEFT, pos=at)
        qtbot.mouseMove(view, at + QPoint(1, -2))
        qtbot.mouseRelease(view, LEFT, pos=at + QPoint(1, -2))
        assert (view._pluck.position, view._pluck.amplitude_mm) == (pytest.approx(0.3, abs=0.003), mm)
    assert len(released) == 2


def test_a_drag_sets_the_amplitude_which_is_never_next_to_nothing(qtbot: QtBot, view: StringView) -> None:
    axes = view._axes()
    start = QPoint(round(axes.x(0.3)), round(axes.y(2.0)))
    qtbot.mousePress(view, LEFT, pos=start)
    for mm, expected in ((3.0, 3.0), (-2.0, 2.0), (0.1, 0.5), (0.0, 0.5)):
        at = QPoint(start.x() + 40, round(axes.y(mm)))
        qtbot.mouseMove(view, at)
        assert view._pluck.amplitude_mm == pytest.approx(expected, abs=0.05)
    qtbot.mouseRelease(view, LEFT, pos=at)
    assert view._pluck.amplitude_mm == 0.5


def test_the_handle_of_a_soft_pluck_is_clicked_without_a_change(qtbot: QtBot, view: StringView) -> None:
    view.pluck_drawn.emit(0.5, 0.2)
    at = handle(view)
    qtbot.mousePress(view, LEFT, pos=at)
    qtbot.mouseMove(view, at + QPoint(1, 0))
    qtbot.mouseRelease(view, LEFT, pos=at + QPoint(1, 0))
    assert view._pluck.amplitude_mm == pytest.approx(0.2)


def test_a_drag_beyond_the_top_grows_steadily(qtbot: QtBot, view: StringView) -> None:
    """The scale steps up under the pointer; the amplitude must not jump with it."""
    at = handle(view)
    qtbot.mousePress(view, LEFT, pos=at)
    before = view._pluck.amplitude_mm
    for _ in range(12):
        at -= QPoint(0, 5)
        qtbot.mouseMove(view, at)
        view.grab()
        assert 0 < view._pluck.amplitude_mm - before < 1.0
        before = view._pluck.amplitude_mm
    assert view._span_mm > 5


def test_the_wheel_over_the_handle_sets_width_and_with_shift_the_shape(view: StringView) -> None:
    widths, shapes = recorded(view.width_stepped), recorded(view.shape_stepped)
    assert wheel(view, handle(view), 120)
    assert wheel(view, handle(view), -60, SHIFT)
    assert wheel(view, handle(view), -60, SHIFT)
    assert not wheel(view, QPoint(100, 200), 120)
    assert (widths, shapes) == ([(1.0,)], [(-1,)])


def test_a_double_click_resets_only_what_was_clicked_at_rest(qtbot: QtBot, view: StringView) -> None:
    resets, plucks = recorded(view.pluck_reset), recorded(view.pluck_released)

    def double_click(at: QPoint) -> None:
        qtbot.mouseClick(view, LEFT, pos=at)
        qtbot.mouseDClick(view, LEFT, pos=at)
        qtbot.mouseRelease(view, LEFT, pos=at)

    double_click(QPoint(200, 100))  # the first click brings the handle there: twice plucked
    assert (resets, len(plucks)) == ([], 2)
    view._last_press_ms = -10_000  # a while later
    double_click(handle(view))
    assert (len(resets), len(plucks)) == (1, 3)


def test_the_pointer_reports_what_can_be_grabbed(qtbot: QtBot, view: StringView) -> None:
    shapes, tips = set(), set()
    axes = view._axes()
    for at in (QPoint(200, 200), handle(view), QPoint(round(axes.x(0.37)), int(axes.bottom) + 8)):
        qtbot.mouseMove(view, at)
        shapes.add(view.cursor().shape())
        tips.add(view.toolTip())
    assert len(shapes) == len(tips) == 3


def test_the_pointer_on_a_warning_reports_all_of_it(qtbot: QtBot, view: StringView) -> None:
    view.set_warning("amplitude 15.39 mm is outside the trained 0.5 … 10 mm")
    qtbot.mouseMove(view, QPoint(200, 12))
    assert view.toolTip() == "amplitude 15.39 mm is outside the trained 0.5 … 10 mm"
    qtbot.mouseMove(view, QPoint(200, 200))
    assert "drag to pluck" in view.toolTip()


def test_two_markers_are_reported_apart_and_reset(qtbot: QtBot, view: StringView) -> None:
    view.set_listening_points(0.2, 0.6)
    moved, resets = recorded(view.listening_point_moved), recorded(view.listening_point_reset)
    axes = view._axes()
    y = int(axes.bottom) + 8
    for side, position in (("left", 0.2), ("right", 0.6)):
        at = QPoint(round(axes.x(position)), y)
        qtbot.mousePress(view, LEFT, pos=at)
        qtbot.mouseMove(view, at + QPoint(20, 0))
        qtbot.mouseRelease(view, LEFT, pos=at)
        assert moved[0] == (side, pytest.approx(position + 20 / axes.length, abs=0.001))
        moved.clear()
    qtbot.mouseDClick(view, LEFT, pos=QPoint(round(axes.x(0.6)), y))
    assert resets == [("right",)]


def test_the_bridge_has_no_marker(qtbot: QtBot, view: StringView) -> None:
    view.set_listening_points(None)
    moved = recorded(view.listening_point_moved)
    axes = view._axes()
    at = QPoint(round(axes.x(0.37)), int(axes.bottom) + 8)
    qtbot.mousePress(view, LEFT, pos=at)
    qtbot.mouseMove(view, at + QPoint(20, 0))
    qtbot.mouseRelease(view, LEFT, pos=at)
    qtbot.keyClick(view, Qt.Key.Key_Left, SHIFT)
    view.grab()
    assert moved == []


@pytest.mark.parametrize(
    ("key", "held", "signal", "values"),
    [
        (Qt.Key.Key_Right, NONE, "pluck_drawn", (pytest.approx(0.51), 4.0)),
        (Qt.Key.Key_Down, NONE, "pluck_drawn", (0.5, 3.5)),
        (Qt.Key.Key_Up, SHIFT, "pluck_drawn", (0.5, pytest.approx(4.05))),
        (Qt.Key.Key_Left, SHIFT, "listening_point_moved", ("left", pytest.approx(0.36))),
        (Qt.Key.Key_Right, SHIFT | CONTROL, "listening_point_moved", ("right", pytest.approx(0.71))),
        (Qt.Key.Key_Up, CONTROL, "width_stepped", (1.0,)),
        (Qt.Key.Key_Left, CONTROL, "shape_stepped", (-1,)),
        (Qt.Key.Key_Delete, NONE, "pluck_reset", ()),
        (Qt.Key.Key_Delete, SHIFT, "listening_point_reset", ("left",)),
    ],
)
def test_everything_by_keyboard(
    qtbot: QtBot,
    view: StringView,
    key: Qt.Key,
    held: Qt.KeyboardModifier,
    signal: str,
    values: tuple[object, ...],
) -> None:
    view.set_listening_points(0.37, 0.7)
    seen = recorded(getattr(view, signal))
    qtbot.keyClick(view, key, held)
    assert seen[0] == values


def picture(view: StringView) -> QImage:
    return view.grab().toImage()


def test_shading_envelope_and_focus_are_seen(qtbot: QtBot, view: StringView) -> None:
    plain = picture(view)
    view.set_trained(TrainedPlucks((0.3, 0.7), (1.0, 2.0)))
    shaded = picture(view)
    axes = view._axes()
    for position, mm in ((0.1, 3.0), (0.9, -3.0), (0.4, 3.0), (0.4, 0.5)):
        at = axes.at(position, mm).toPoint()
        assert any(shaded.pixel(at + QPoint(i, 0)) != plain.pixel(at + QPoint(i, 0)) for i in range(8)), (
            position,
            mm,
        )
    inside = axes.at(0.42, 1.5).toPoint()
    assert shaded.pixel(inside) == plain.pixel(inside)
    still = np.zeros(101, np.float32)
    both = {"model": still, "truth": still}
    view.show_frame(StringFrame(both, both, both))
    without = picture(view)
    reach = dict.fromkeys(both, (still - 0.05, still + 0.05))
    view.show_frame(StringFrame(both, both, both, envelopes=reach))
    at = view._axes().at(0.42, 0.03).toPoint()
    assert picture(view).pixel(at) != without.pixel(at)


def test_of_two_motions_in_one_place_both_are_seen(view: StringView) -> None:
    """And of two that part only the one that is there."""
    shape = 2 * np.sin(np.pi * np.linspace(0, 1, 101)).astype(np.float32)

    def seen(mm: float) -> int:
        """How many pixels on the model's line are of the truth's hue, which has more blue in it than red."""
        shapes = {"model": shape, "truth": shape - np.float32(mm)}
        view.show_frame(StringFrame(shapes, shapes, shapes))
        drawn, axes = picture(view), view._axes()
        line = [axes.at(place, 2 * np.sin(np.pi * place)).toPoint() for place in np.linspace(0.1, 0.9, 400)]
        colours = [drawn.pixelColor(at) for at in line]
        return sum(colour.blue() > colour.red() + 40 for colour in colours)

    assert seen(0.5) == 0
    assert 80 < seen(0.0) < 200


def test_the_pluck_comes_back_when_no_motion_is_shown(view: StringView) -> None:
    rest = picture(view)
    still = np.zeros(101, np.float32)
    both = {"model": still, "truth": still}
    view.show_frame(StringFrame(both, both, both))
    assert picture(view) != rest
    view.show_frame(None)
    picture(view)  # its scale comes back first
    assert picture(view) == rest


def test_the_switches_say_what_is_wanted_and_show_what_is(qtbot: QtBot, view: StringView) -> None:
    motion, envelope = view._toggles
    view.set_shown(True, False)
    assert (motion.isChecked(), envelope.isChecked()) == (True, False)
    asked = recorded(view.motion_toggled)
    qtbot.mouseClick(motion, LEFT)
    assert asked == [(False,)]
    view.set_shown(False, True)
    assert not envelope.isEnabled()
