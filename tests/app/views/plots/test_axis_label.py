"""Labels and numbers of axes give way where there is little room, and come back."""

from __future__ import annotations

from itertools import pairwise

import pyqtgraph as pg
from pytestqt.qtbot import QtBot

from app.presets.library import Library
from app.session.choices import Session
from app.views.plots.axis_label import TICK_PIXELS, UprightLabel, UprightTicks, sparse
from app.window.panels.error_plane import ErrorPlanePanel

TICKS = [(float(place), f"{place}") for place in range(11)]


def test_numbers_that_would_touch_are_left_out_the_ends_last() -> None:
    assert sparse(TICKS, 1) == TICKS
    assert [text for _, text in sparse(TICKS, 2)] == ["0", "2", "4", "6", "8", "10"]
    assert [text for _, text in sparse(TICKS, 4)] == ["0", "4", "10"]
    assert [text for _, text in sparse(TICKS, 10)] == ["0", "10"]
    assert [text for _, text in sparse(TICKS, 99)] == ["0"]
    assert sparse([], 1) == []


def test_a_label_takes_the_wording_that_fits(qtbot: QtBot) -> None:
    plot = pg.PlotWidget()
    qtbot.addWidget(plot)
    plot.resize(300, 300)
    plot.show()
    label, axis = UprightLabel(plot.getPlotItem(), ("amplitude (mm)", "mm")), plot.getPlotItem().getAxis("left")
    qtbot.waitUntil(lambda: axis.labelText == "amplitude (mm)")
    plot.resize(300, 100)
    qtbot.waitUntil(lambda: axis.labelText == "mm")
    assert axis.label.isVisible()
    label.set("a much longer wording than that", "a wording that is too long as well")
    assert not axis.label.isVisible()
    plot.resize(300, 400)
    qtbot.waitUntil(lambda: axis.labelText == "a much longer wording than that")
    assert axis.label.isVisible()


def test_numbers_follow_height_and_range(qtbot: QtBot) -> None:
    plot = pg.PlotWidget()
    qtbot.addWidget(plot)
    plot.resize(300, 400)
    plot.show()
    item = plot.getPlotItem()
    item.setYRange(0, 10, padding=0)
    ticks = UprightTicks(item.getAxis("left"), item.vb)
    ticks.set(TICKS, between=(0.5,))
    shown = lambda: [text for _, text in item.getAxis("left")._tickLevels[0]]  # noqa: E731
    qtbot.waitUntil(lambda: len(shown()) == 11)
    plot.resize(300, 90)
    qtbot.waitUntil(lambda: len(shown()) * TICK_PIXELS <= 110)
    item.setYRange(0, 3, padding=0)
    qtbot.waitUntil(lambda: shown() == ["0", "1", "2", "3"])
    ticks.set(None)
    assert item.getAxis("left")._tickLevels is None


def test_a_low_error_map_has_no_clipped_words(qtbot: QtBot) -> None:
    view = ErrorPlanePanel(Session(), Library([]))
    qtbot.addWidget(view)
    view.show()
    for height, label, foot in ((400, "amplitude (mm)", True), (130, "mm", False), (400, "amplitude (mm)", True)):
        view.resize(420, height)
        item = view.map.getPlotItem()
        qtbot.waitUntil(lambda item=item, label=label: item.getAxis("left").labelText == label)
        assert item.getAxis("bottom").label.isVisible() == foot
        for axis, box in ((item.getAxis("left"), item.vb), (view.map._bar.axis, view.map._bar.vb)):
            low, high = axis.range
            places = [place for place, _ in axis._tickLevels[0]]
            pixels = box.boundingRect().height() / (high - low)
            gaps = [(after - before) * pixels for before, after in pairwise(places)]
            assert len(places) >= 2
            assert min(gaps) >= TICK_PIXELS - 0.01
