"""What lies behind the string says what the model was not trained on, where it can be read."""

from __future__ import annotations

import pytest
from PySide6.QtGui import QImage, QPainter
from pytestqt.qtbot import QtBot

from app.views.string.axes import StringAxes
from app.views.string.ground import TrainedPlucks, paint_ground


class Recorder(QPainter):
    """Keeps what is written."""

    def __init__(self, image: QImage) -> None:
        super().__init__(image)
        self.written: list[str] = []

    def drawText(self, *arguments: object) -> None:
        self.written.append(str(arguments[-1]))


@pytest.mark.parametrize(("pluck", "count"), [(0, 2), (None, 0)])
def test_words_are_written_beside_a_pluck_and_not_under_a_motion_that_covers_them(
    qtbot: QtBot, pluck: int | None, count: int
) -> None:
    image = QImage(1200, 300, QImage.Format.Format_ARGB32)  # the painter does not keep it
    painter = Recorder(image)
    paint_ground(painter, StringAxes(1200, 300, 5.0), TrainedPlucks((0.3, 0.7)), pluck)
    painter.end()
    assert painter.written.count("not trained here") == count
