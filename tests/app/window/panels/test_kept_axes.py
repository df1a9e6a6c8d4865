"""Axes are painted when they change, and not with every curve: that is most of what a painting takes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyqtgraph as pg
import pytest
from pytestqt.qtbot import QtBot

from app.presets.library import Library
from app.session.choices import Session
from app.window.panels.spectrum import SpectrumPanel, analyser_at
from app.window.panels.waveform import WaveformPanel

RATE_HZ = 16_000


@pytest.fixture
def painted(monkeypatch: pytest.MonkeyPatch) -> list[pg.AxisItem]:
    """Axes that have been painted, each time."""
    found: list[pg.AxisItem] = []
    paint = pg.AxisItem.paint

    def watched(self: pg.AxisItem, *arguments: object) -> None:
        found.append(self)
        paint(self, *arguments)

    monkeypatch.setattr(pg.AxisItem, "paint", watched)
    return found


def draw_waveform(view: WaveformPanel, turn: int) -> None:
    view.set_scale(1.0, "displacement", "mm")
    view.show_signal("model", np.sin(np.arange(100 * (turn + 1)) / 9).astype(np.float32), RATE_HZ)


def draw_spectrum(view: SpectrumPanel, turn: int) -> None:
    view.show_signal("model", np.sin(np.arange(4096) / (9 + turn)).astype(np.float32), analyser_at(RATE_HZ))


@pytest.mark.parametrize(
    ("make", "draw"), [(WaveformPanel, draw_waveform), (SpectrumPanel, draw_spectrum)], ids=["waveform", "spectrum"]
)
def test_axes_stay_while_curves_move(
    qtbot: QtBot, painted: list[pg.AxisItem], make: Callable[..., pg.QtWidgets.QWidget], draw: Callable[..., None]
) -> None:
    view = make(Session(), Library([]))
    qtbot.addWidget(view)
    view.resize(500, 300)
    with qtbot.waitExposed(view):
        view.show()
    draw(view, 0)
    qtbot.waitUntil(lambda: painted != [])  # once
    qtbot.wait(100)
    painted.clear()
    for turn in range(1, 6):
        draw(view, turn)
        qtbot.wait(30)
    assert painted == []


def test_what_is_kept_follows_the_view(qtbot: QtBot, painted: list[pg.AxisItem]) -> None:
    view = WaveformPanel(Session(), Library([]))
    qtbot.addWidget(view)
    view.resize(500, 300)
    view.plot.set_times(2.0, 1.0)
    with qtbot.waitExposed(view):
        view.show()
    qtbot.wait(100)
    item = view.plot.getPlotItem()
    for change, side in (
        (lambda: view.plot.zoom(0.5), "bottom"),
        (lambda: view.set_scale(3.0, "velocity", "m/s"), "left"),
    ):
        painted.clear()
        change()
        qtbot.waitUntil(lambda side=side: item.getAxis(side) in painted)  # type: ignore[misc]
