"""The picture of a drum: clicks strike where they point, marks are dragged, and colours show displacement."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QColor
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from app.session.shown import DEFAULT_SOURCES
from app.views import theme
from app.views.drum.axes import HeadAxes
from app.views.drum.ink import HeadFrame, angle_words, fitting_scale_m, image_of, kept_scale_m
from app.views.drum.view import DrumView

LEFT = Qt.MouseButton.LeftButton
SHIFT, CONTROL = Qt.KeyboardModifier.ShiftModifier, Qt.KeyboardModifier.ControlModifier


@pytest.fixture
def view(qtbot: QtBot) -> DrumView:
    made = DrumView()
    qtbot.addWidget(made)
    made.resize(900, 320)
    made.set_drum("Tom, A2", "circle", (0.33, 0.33))
    made.set_plain(True)
    made.set_sources(DEFAULT_SOURCES[:1])
    made.show()
    return made


def pixel(point: QPointF) -> QPoint:
    return QPoint(round(point.x()), round(point.y()))


@pytest.mark.parametrize("shape", ["circle", "rectangle", "bar"])
@pytest.mark.parametrize("heads", [1, 2])
def test_places_lead_to_pixels_and_back(shape: str, heads: int) -> None:
    axes = HeadAxes(900, 320, shape, (0.4, 0.2), heads)  # type: ignore[arg-type]
    for head in range(heads):
        for place in ((0.0, 0.0), (0.5, -0.3), (-0.6, 0.7)):
            found = axes.place(axes.at(head, place))
            assert found == pytest.approx(place)
        area = axes.rect(head)
        assert area.left() >= 0
        assert area.right() <= 900
        assert area.height() / area.width() == pytest.approx(0.5)
        assert axes.point(head, axes.x(head, 0.3)) == pytest.approx(0.3)
    assert axes.place(QPointF(2, 2)) is None
    corner = axes.place(axes.at(0, (0.9, 0.9)))
    assert (corner is None) == (shape == "circle")


def test_a_click_strikes_there_and_with_shift_hard(qtbot: QtBot, view: DrumView) -> None:
    struck: list[tuple[float, float, bool]] = []
    view.struck.connect(lambda *blow: struck.append(blow))
    at = pixel(view.axes.at(0, (0.4, -0.5)))
    QTest.mouseClick(view, LEFT, pos=at)
    QTest.mouseClick(view, LEFT, SHIFT, pos=at)
    QTest.mouseDClick(view, LEFT, pos=at)
    QTest.mouseClick(view, LEFT, pos=QPoint(3, 3))
    QTest.mouseClick(view, Qt.MouseButton.RightButton, pos=at)
    assert [blow[2] for blow in struck] == [False, True, False]
    for x, y, _ in struck:
        assert (x, y) == pytest.approx((0.4, -0.5), abs=0.01)


def test_a_mark_is_dragged_and_reset(qtbot: QtBot, view: DrumView) -> None:
    view.set_listening_points(0.3, 0.8)
    moved, reset, strokes = [], [], []
    view.listening_point_moved.connect(lambda *to: moved.append(to))
    view.listening_point_reset.connect(reset.append)
    view.struck.connect(lambda *blow: strokes.append(blow))
    axes = view.axes
    foot = QPoint(round(axes.x(0, 0.8)), round(axes.bottom) + 8)
    QTest.mousePress(view, LEFT, pos=foot)
    QTest.mouseMove(view, QPoint(round(axes.x(0, 0.6)), foot.y()))
    QTest.mouseMove(view, QPoint(5_000, foot.y()))
    QTest.mouseRelease(view, LEFT, pos=foot)
    assert [side for side, _ in moved] == ["right", "right"]
    assert moved[0][1] == pytest.approx(0.6, abs=0.01)
    assert moved[1][1] == 1.0
    QTest.mouseDClick(view, LEFT, pos=QPoint(round(axes.x(0, 0.3)), foot.y()))
    assert reset == ["left"]
    assert strokes == []


def test_keys_move_the_place_the_mark_and_reset_them(qtbot: QtBot, view: DrumView) -> None:
    places, marks, resets = [], [], []
    view.place_moved.connect(lambda *to: (places.append(to), view.set_place(to)))
    view.listening_point_moved.connect(lambda *to: marks.append(to))
    view.place_reset.connect(lambda: resets.append("place"))
    view.listening_point_reset.connect(resets.append)
    view.set_listening_points(0.5, 0.7)
    for key in (Qt.Key.Key_Right, Qt.Key.Key_Up, Qt.Key.Key_Left, Qt.Key.Key_Down):
        QTest.keyClick(view, key)
    assert places == [pytest.approx(to) for to in ((0.05, 0.0), (0.05, 0.05), (0.0, 0.05), (0.0, 0.0))]
    QTest.keyClick(view, Qt.Key.Key_Right, SHIFT)
    QTest.keyClick(view, Qt.Key.Key_Left, SHIFT | CONTROL)
    assert marks == [("left", pytest.approx(0.51)), ("right", pytest.approx(0.69))]
    QTest.keyClick(view, Qt.Key.Key_Delete)
    QTest.keyClick(view, Qt.Key.Key_Delete, SHIFT)
    assert resets == ["place", "left", "right"]
    view.set_place((0.97, 0.0))
    QTest.keyClick(view, Qt.Key.Key_Right)
    assert len(places) == 4, "the rim is not struck"


def test_it_has_a_name_and_says_what_it_shows(view: DrumView) -> None:
    view.set_place((0.25, -0.5))
    view.set_listening_points(0.25)
    assert view.accessibleName() == "Drum"
    assert view.accessibleDescription() == "Tom, A2, struck at +0.25, -0.50, heard from 30° left"
    assert [angle_words(point) for point in (0.0, 0.5, 0.75, 1.0)] == ["90° left", "above", "30° right", "90° right"]


def test_up_is_amber_down_is_blue_and_rest_is_the_panel(view: DrumView) -> None:
    columns = np.broadcast_to(np.linspace(-1, 1, 57), (57, 57))
    frame = HeadFrame({"model": (1e-3 * columns).astype(np.float32)})
    view.show_frame(frame)
    picture = view.grab().toImage()
    right, left, middle = (QColor(picture.pixel(pixel(view.axes.at(0, (x, 0.4))))) for x in (0.8, -0.8, 0.0))
    assert right.red() > right.blue() + 60
    assert left.blue() > left.red() + 60
    panel = QColor(theme.PANEL)
    assert max(abs(middle.red() - panel.red()), abs(middle.blue() - panel.blue())) < 30
    before = picture
    view.show_frame(HeadFrame({"model": -frame.pictures_m["model"]}))
    after = view.grab().toImage()
    assert after != before
    view.show_frame(None)
    at_rest = QColor(view.grab().toImage().pixel(pixel(view.axes.at(0, (0.8, 0.4)))))
    assert at_rest == panel


def test_two_slots_have_a_picture_each(view: DrumView) -> None:
    view.set_sources(DEFAULT_SOURCES)
    assert view.axes.heads == 2
    up, down = np.full((57, 57), 1e-3, np.float32), np.full((57, 57), -1e-6, np.float32)
    view.show_frame(HeadFrame({"model": up, "truth": down}))
    picture = view.grab().toImage()
    first, second = (QColor(picture.pixel(pixel(view.axes.at(head, (0.5, 0.3))))) for head in (0, 1))
    assert first.red() > first.blue()
    assert second.blue() > second.red(), "each has a scale of its own"


def test_scales_are_round_and_stay_while_they_fit() -> None:
    assert fitting_scale_m(0.8e-3) == pytest.approx(1e-3)
    assert fitting_scale_m(1e-3) == pytest.approx(1e-3)
    assert fitting_scale_m(1.1e-3) == pytest.approx(1.5e-3)
    assert fitting_scale_m(8e-9) == pytest.approx(1e-8)
    assert kept_scale_m(1.2e-3, 2e-3) == pytest.approx(2e-3)
    assert kept_scale_m(0.9e-3, 2e-3) == pytest.approx(1.5e-3)
    assert kept_scale_m(4e-3, 2e-3) == pytest.approx(5e-3)


def test_colours_end_at_the_scale() -> None:
    picture = np.array([[-3.0, -1.0, 0.0, 1.0, 3.0]], np.float32) * 1e-3
    image = image_of(picture, 1e-3)
    colours = [image.pixelColor(column, 0).name() for column in range(5)]
    assert colours[0] == colours[1]
    assert colours[3] == colours[4]
    assert colours[2] == theme.PANEL
