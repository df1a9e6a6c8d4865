"""The legend says what is drawn, and less of it where there is little room."""

from __future__ import annotations

import pyqtgraph as pg
from pytestqt.qtbot import QtBot

from app.session.shown import DEFAULT_SOURCES, ShownSource
from app.views.plots.legend import SHARE, Legend

LONG = (
    ShownSource("preset:long", "A", "Classical guitar, nylon B3, plucked anywhere", heard=True),
    ShownSource("difference", "B", "difference", gain_db=20.0),
)


def drawn(legend: Legend) -> str:
    """What fits."""
    from PySide6.QtGui import QFontMetrics

    from app.views import theme
    from app.views.plots.legend import _texts

    return " ".join(_texts(legend._sources, QFontMetrics(theme.small_font(12, bold=True)), legend.width() - 12))


def test_it_stands_in_the_corner_and_gives_way(qtbot: QtBot) -> None:
    plot = pg.PlotWidget()
    qtbot.addWidget(plot)
    plot.resize(900, 200)
    plot.show()
    legend = Legend(plot)
    legend.show_sources(LONG)
    assert legend.text == "A  Classical guitar, nylon B3, plucked anywhere · heard   B  difference +20 dB"
    for width in (900, 400, 260):
        plot.resize(width, 200)
        area = plot.getPlotItem().vb.sceneBoundingRect
        qtbot.waitUntil(lambda area=area: abs(legend.geometry().right() + 5 - area().right()) < 4)
        assert legend.width() <= SHARE * area().width() + 1
        assert ("anywhere" in drawn(legend)) == (width == 900)
        assert ("heard" in drawn(legend)) == (width == 900)
        assert "+20 dB" in drawn(legend)
    legend.show_sources(DEFAULT_SOURCES, "mode 2, left")
    assert legend.accessibleName() == "Drawn: mode 2, left   A  model · heard   B  truth"
