"""A line over a plot: it is seen where it should be and nowhere else, and the plot beneath it stays right."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
import pytest
from numpy.typing import NDArray
from PySide6.QtGui import QColor, QImage
from pytestqt.qtbot import QtBot

from app.views import theme
from app.views.plots.kept_plot import KeptPlot


@pytest.fixture
def plot(qtbot: QtBot) -> KeptPlot:
    made = KeptPlot()
    qtbot.addWidget(made)
    made.resize(400, 200)
    made.setXRange(0, 1, padding=0)
    made.plot([0, 1], [0, 1], pen=pg.mkPen(theme.MODEL, width=1))
    with qtbot.waitExposed(made):
        made.show()
    return made


def seen(plot: KeptPlot) -> NDArray[np.uint8]:
    """(height, width, 4): blue, green, red, alpha."""
    image = plot.grab().toImage().convertToFormat(QImage.Format.Format_ARGB32)
    return np.array(image.constBits()).reshape(image.height(), image.width(), 4).copy()


def line_columns(plot: KeptPlot) -> list[int]:
    colour = QColor(theme.TEXT)
    wanted = np.array([colour.blue(), colour.green(), colour.red(), 255], np.uint8)
    return list(np.flatnonzero((seen(plot) == wanted).all(axis=2).sum(axis=0) > 100))


def test_the_line_is_where_it_was_put(qtbot: QtBot, plot: KeptPlot) -> None:
    places = []
    for at in (0.2, 0.5, 0.8):
        plot.move_line(at)
        qtbot.wait(30)
        (column,) = line_columns(plot)
        places.append(column)
    assert np.diff(places, n=2) == pytest.approx(0, abs=1)
    plot.move_line(1.5)
    qtbot.wait(30)
    assert line_columns(plot) == []


def test_a_moved_line_leaves_the_plot_as_it_was(qtbot: QtBot, plot: KeptPlot) -> None:
    painted: list[int] = []
    scene = plot.scene()
    scene.sigPrepareForPaint.connect(lambda: painted.append(1))
    plot.move_line(2.0)
    qtbot.wait(30)
    before = plot._painted().toImage()
    painted.clear()
    for at in np.linspace(0.1, 0.9, 9):
        plot.move_line(float(at))
        qtbot.wait(20)
    assert len(painted) <= 1  # the kept picture is made once
    assert plot._picture is not None
    assert plot._picture.toImage() == before


def test_a_changed_plot_is_painted_again(qtbot: QtBot, plot: KeptPlot) -> None:
    plot.move_line(0.4)
    qtbot.wait(30)
    plot.move_line(0.5)
    qtbot.wait(30)
    kept = plot._picture
    assert kept is not None
    plot.plot([0, 1], [1, 0], pen=pg.mkPen(theme.TRUTH, width=1))
    qtbot.wait(30)
    plot.move_line(0.6)
    qtbot.wait(30)
    assert plot._picture is not None
    assert plot._picture.toImage() != kept.toImage()
