"""What lies behind the string says what the model was not trained on, where it can be read."""

from __future__ import annotations

from itertools import pairwise

import pytest
from PySide6.QtGui import QFont, QFontMetrics, QImage, QPainter
from pytestqt.qtbot import QtBot

from app.views.stage import LABEL_GAP, label_places
from app.views.string.axes import StringAxes
from app.views.string.ground import TrainedPlucks, paint_ground, scale


class Recorder(QPainter):
    """Keeps what is written."""

    def __init__(self, image: QImage) -> None:
        super().__init__(image)
        self.written: list[str] = []

    def drawText(self, *arguments: object) -> None:
        self.written.append(str(arguments[-1]))


@pytest.mark.parametrize(("height", "figures"), [(300, 5), (112, 3), (90, 1)])
def test_the_scale_has_as_many_figures_as_there_is_height_for(qtbot: QtBot, height: int, figures: int) -> None:
    axes = StringAxes(1200, height, 5.0)
    assert len(scale(axes)) == figures
    image = QImage(1200, height, QImage.Format.Format_ARGB32)
    painter = Recorder(image)
    paint_ground(painter, axes, TrainedPlucks((0.3, 0.7)), 0)
    painter.end()
    assert sum(text[-1].isdigit() or text.endswith("mm") for text in painter.written) >= figures
    assert painter.written.count("not trained here") == (2 if height == 300 else 0)


@pytest.mark.parametrize("points", [(0.10, 0.15), (0.15, 0.10), (0.0, 0.01), (0.99, 1.0), (0.5, 0.5), (0.2, 0.8)])
def test_the_names_of_two_listening_points_do_not_cover_each_other(qtbot: QtBot, points: tuple[float, float]) -> None:
    axes = StringAxes(560, 200, 5.0)
    marks = [(axes.x(point), f"{name} {point:.2f}") for name, point in zip(("left", "right"), points, strict=True)]
    places = label_places(QFontMetrics(QFont()), marks, axes.width, axes.bottom)
    assert {text for _, text in places} == {text for _, text in marks}
    for (before, _), (after, _) in pairwise(places):
        assert after.left() >= before.right() + LABEL_GAP - 0.01
    assert all(place.left() >= 0 and place.right() <= axes.width for place, _ in places)
    if points == (0.2, 0.8):  # each under its point
        assert [place.center().x() for place, _ in places] == pytest.approx([axes.x(point) for point in points])
