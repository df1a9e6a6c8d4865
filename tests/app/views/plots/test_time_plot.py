"""Gestures and keys that all plots over time share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent, QWheelEvent
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.views.plots.time_plot import TimePlot

Key = Qt.Key


@pytest.fixture
def plot(qtbot: QtBot) -> Iterator[TimePlot]:
    made = TimePlot("A plot", "A tip")
    qtbot.addWidget(made)
    made.resize(640, 240)
    with qtbot.waitExposed(made):
        made.show()
    made.set_times(4.0, 0.25)
    made.getPlotItem().setYRange(0, 1, padding=0)
    QApplication.processEvents()
    return made


def place_of(plot: TimePlot, time_s: float, height: float) -> QPoint:
    return plot.mapFromScene(plot.getPlotItem().vb.mapViewToScene(QPointF(time_s, height)))


def turn(plot: TimePlot, place: QPoint, steps: int) -> None:
    where = QPointF(place)
    buttons, keys = Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier
    event = QWheelEvent(
        where, where, QPoint(), QPoint(0, 120 * steps), buttons, keys, Qt.ScrollPhase.NoScrollPhase, False
    )
    QApplication.sendEvent(plot.viewport(), event)


def test_the_end_of_training_is_set_off_from_a_picture(qtbot: QtBot) -> None:
    for shaded in (True, False):
        plot = TimePlot("t", "", shaded=shaded)
        qtbot.addWidget(plot)
        plot.set_times(2.0, 0.5)
        assert plot.horizon.isVisible()
        assert plot._edge.isVisible() != shaded
        assert plot._edge.value() == 0.5
        assert plot._edge.pen.width() > plot.horizon.pen.width()
        plot.set_times(2.0, 3.0)
        assert not plot._edge.isVisible()


def test_the_keyboard_seeks_and_zooms(qtbot: QtBot, plot: TimePlot) -> None:
    asked: list[float] = []
    plot.seek_asked.connect(asked.append)
    plot.show_playhead(1.0)
    for key in (Key.Key_Right, Key.Key_Left, Key.Key_Home):
        qtbot.keyClick(plot, key)
    assert asked == pytest.approx([1.1, 0.9, 0.0])
    qtbot.keyClick(plot, Key.Key_Plus)
    low, high = plot.times_s
    assert low < 1.0 < high
    assert high - low == pytest.approx(4.0 / 1.25**2)
    qtbot.keyClick(plot, Key.Key_Minus)
    assert plot.times_s == pytest.approx((0, 4), abs=1e-6)
    plot.show_times(1.0, 1.02)
    qtbot.keyClick(plot, Key.Key_Right)
    assert asked[-1] == pytest.approx(1.001)  # no more than a little of the view
    qtbot.keyClick(plot, Key.Key_0)
    assert plot.times_s == pytest.approx((0, 4))


def test_the_wheel_zooms_about_the_mouse(plot: TimePlot) -> None:
    place = place_of(plot, 3.0, 0.5)
    turn(plot, place, 4)
    low, high = plot.times_s
    assert high - low == pytest.approx(4 / 1.25**4)
    assert (3.0 - low) / (high - low) == pytest.approx(0.75, abs=0.01)
    turn(plot, place, 60)
    low, high = plot.times_s
    assert high - low == pytest.approx(0.002)
    turn(plot, place, -100)
    assert plot.times_s == pytest.approx((0, 4))


def test_the_right_button_pans_and_stops_at_the_ends(qtbot: QtBot, plot: TimePlot) -> None:
    plot.show_times(1.0, 2.0)
    QApplication.processEvents()
    start, view = place_of(plot, 1.5, 0.5), plot.viewport()
    right = Qt.MouseButton.RightButton
    qtbot.mousePress(view, right, pos=start)
    qtbot.mouseMove(view, start)
    move = place_of(plot, 1.25, 0.5)

    def drag_to(place: QPoint) -> None:
        where = QPointF(place)
        none = Qt.KeyboardModifier.NoModifier
        event = QMouseEvent(QEvent.Type.MouseMove, where, where, right, right, none)
        QApplication.sendEvent(view, event)

    drag_to(move)
    assert plot.times_s == pytest.approx((1.25, 2.25), abs=0.01)
    drag_to(move - QPoint(5000, 0))
    assert plot.times_s == pytest.approx((3, 4))
    qtbot.mouseRelease(view, right, pos=move)


def test_shift_reports_the_place_too(qtbot: QtBot, plot: TimePlot) -> None:
    seeks: list[float] = []
    points: list[tuple[float, float]] = []
    plot.seek_asked.connect(seeks.append)
    plot.pointed.connect(lambda *point: points.append(point))
    place = place_of(plot, 2.0, 0.25)
    qtbot.mouseClick(plot.viewport(), Qt.MouseButton.LeftButton, pos=place)
    assert points == []
    qtbot.mouseClick(plot.viewport(), Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ShiftModifier, pos=place)
    assert seeks == pytest.approx([2.0, 2.0], abs=0.02)
    assert points[0] == pytest.approx((2.0, 0.25), abs=0.02)


def test_what_is_in_view_stays_for_a_take_of_the_same_length(plot: TimePlot) -> None:
    plot.show_times(0.5, 0.7)
    plot.set_times(4.0, 0.5)
    assert plot.times_s == pytest.approx((0.5, 0.7))
    plot.set_times(2.0, 0.5)
    assert plot.times_s == pytest.approx((0, 2))


def test_the_end_of_training_is_marked_where_it_lies_within(plot: TimePlot) -> None:
    assert plot.horizon.isVisible()
    assert plot.horizon.value() == 0.25
    assert plot._untrained.getRegion() == (0.25, 4.0)
    plot.set_times(0.2, 0.25)
    assert not plot.horizon.isVisible()
    assert not plot._untrained.isVisible()
