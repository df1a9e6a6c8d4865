"""A line over a plot: it is seen where it should be and nowhere else, and the plot beneath it stays right."""

from __future__ import annotations

from itertools import cycle

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


def wait_for_line(qtbot: QtBot, plot: KeptPlot) -> None:
    """Until it is drawn where it was put."""
    qtbot.waitUntil(lambda: plot._moved.isEmpty() and plot._strip == plot._line_strip())


def wait_for_picture(qtbot: QtBot, plot: KeptPlot) -> None:
    """Until the line moves over a picture of the plot, which is painted whole before, however late."""
    places = cycle((0.3, 0.6))

    def is_kept() -> bool:
        plot.move_line(next(places))
        return plot._picture is not None

    qtbot.waitUntil(is_kept)
    wait_for_line(qtbot, plot)


def test_the_line_is_where_it_was_put(qtbot: QtBot, plot: KeptPlot) -> None:
    places = []
    for at in (0.2, 0.5, 0.8):
        plot.move_line(at)
        wait_for_line(qtbot, plot)
        (column,) = line_columns(plot)
        places.append(column)
    assert np.diff(places, n=2) == pytest.approx(0, abs=1)
    plot.move_line(1.5)
    wait_for_line(qtbot, plot)
    assert line_columns(plot) == []


def test_a_moved_line_leaves_the_plot_as_it_was(qtbot: QtBot, plot: KeptPlot) -> None:
    wait_for_picture(qtbot, plot)
    kept, painted = plot._picture, list[int]()
    assert kept is not None
    plot.scene().sigPrepareForPaint.connect(lambda: painted.append(1))
    for at in np.linspace(0.1, 0.9, 9):
        plot.move_line(float(at))
        wait_for_line(qtbot, plot)
    assert painted == [], "the kept picture is made once"
    assert plot._picture is kept
    assert plot._painted().toImage() == kept.toImage()


def test_a_changed_plot_is_painted_again(qtbot: QtBot, plot: KeptPlot) -> None:
    wait_for_picture(qtbot, plot)
    kept = plot._picture
    assert kept is not None
    plot.plot([0, 1], [1, 0], pen=pg.mkPen(theme.TRUTH, width=1))
    qtbot.waitUntil(lambda: plot._picture is None)
    wait_for_picture(qtbot, plot)
    assert plot._picture is not None
    assert plot._picture.toImage() != kept.toImage()
