"""A panel with a take of known motion, and what its plots show."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pyqtgraph as pg
import pytest
from numpy.typing import NDArray
from PySide6.QtCore import QPoint, QPointF
from PySide6.QtGui import QColor

from app.presets.library import Library
from app.rendering import Take
from app.session.choices import Choices
from app.stage.session import Session
from app.stage.stage import changed_names
from app.views import theme
from app.views.plots.plots import dress_plots
from app.window.panels import Moment, Panel
from engine.pluck import Pluck
from engine.presets import read_info
from engine.values.ear import Ear
from tests.app.takes import append_to

FRAMES = 4001  # a second
Make = Callable[[type[Panel]], Any]
Hear = Callable[[Take, Ear], None]


@pytest.fixture
def take(small_preset, hear) -> Take:
    """A decaying first mode of 4 mm; the model is 1 % too loud."""
    made = Take("small", read_info(small_preset), Pluck(0.5, 4.0, "gaussian", 0.06), 1.0, Choices().ear)
    time_s = np.arange(FRAMES)[:, None] / 4000
    swing = np.exp(-3 * time_s) * np.cos(2 * np.pi * made.fundamental_hz * time_s)
    truth = (0.004 * swing * np.sin(np.pi * np.linspace(0, 1, 101))).astype(np.float32)
    append_to(made, np.float32(1.01) * truth, truth)
    hear(made, Choices().ear)
    return made


@pytest.fixture
def make(qtbot, take, threads_begun) -> Iterator[Make]:
    """Makes panels that can be seen, with the take; at their end none leaves a thread."""
    panels: list[Panel] = []
    dress_plots()

    def made(kind: type[Panel]) -> Panel:
        panel = kind(Session(Choices(face="lab")), Library([]))
        panels.append(panel)
        panel.choices_changed(frozenset(Choices.model_fields))
        qtbot.addWidget(panel)
        panel.resize(700, 300)
        with qtbot.waitExposed(panel):
            panel.show()
        panel.take_started(take)
        return panel

    yield made
    for panel in panels:
        panel.end()
    assert threads_begun() == []


@pytest.fixture
def watch(qtbot, take) -> Callable[[Panel, Callable[[], object]], None]:
    """Shows a panel moments of the take until it is so."""

    def watched(panel: Panel, until: Callable[[], object], position_s: float = 0.5) -> None:
        def tick() -> bool:
            panel.show_moment(Moment(take, position_s, False, 0.016))
            return bool(until())

        qtbot.waitUntil(tick)

    return watched


def choose(panel: Panel, **choices: Any) -> None:
    """Change choices, and tell the panel as the window does."""
    before = panel.session.stage
    panel.session.update(**choices)
    panel.choices_changed(changed_names(before, panel.session.stage))


def items(plot: pg.PlotWidget, kind: type[Any]) -> list[Any]:
    """The visible things of this kind in a plot, in their order."""
    return [each for each in plot.getPlotItem().items if isinstance(each, kind) and each.isVisible()]


def curves(plot: pg.PlotWidget, dotted: bool = False) -> dict[str, NDArray[np.float64]]:
    """The visible curves, (2, points), by the kind of source whose colour they have."""
    kinds = {QColor(hue).name(): kind for kind, hue in theme.SOURCE_COLOURS.items()}
    found = {}
    for item in items(plot, pg.PlotDataItem):
        pen, data = pg.mkPen(item.opts["pen"]), item.getData()
        if (pen.style() == pg.QtCore.Qt.PenStyle.DotLine) == dotted and pen.color().name() in kinds:
            found[kinds[pen.color().name()]] = np.array(data if data[0] is not None else [[], []])
    return found


def bar_of(plot: pg.PlotWidget) -> pg.ColorBarItem:
    """The scale of its colours."""
    return next(each for each in plot.scene().items() if isinstance(each, pg.ColorBarItem))


def label_of(plot: pg.PlotWidget) -> str:
    """The label of the vertical axis."""
    return str(plot.getPlotItem().getAxis("left").labelText)


def at(plot: pg.PlotWidget, x: float, y: float) -> QPoint:
    """The pixel of a place on the axes."""
    return plot.mapFromScene(plot.getPlotItem().vb.mapViewToScene(QPointF(x, y)))
