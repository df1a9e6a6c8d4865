"""Both themes can be read, and a plot that was made under one takes on the other."""

from __future__ import annotations

from dataclasses import replace

import pyqtgraph as pg
import pytest
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QApplication, QCheckBox
from pytestqt.qtbot import QtBot

from app.presets.library import Library
from app.session.shown import ShownSource
from app.stage.session import Session
from app.views import theme
from app.views.plots.colour_maps import displacement_map, error_map, level_map, share_map
from app.views.plots.plots import recolour
from app.window.panels.waveform import WaveformPanel
from tests.app.gestures import picture


@pytest.mark.parametrize("chosen", [theme.DARK, theme.LIGHT], ids=["dark", "light"])
def test_text_can_be_read_on_every_ground_and_no_two_roles_share_a_colour(chosen: theme.Theme) -> None:
    """Else a plot could not know which role to take on."""
    for ground in (chosen.background, chosen.panel, chosen.raised, chosen.ground_top, chosen.ground_bottom):
        for text in (chosen.text, chosen.faint, chosen.model, chosen.truth, chosen.warning, chosen.good):
            assert theme.contrast(text, ground) >= 4.5, (text, ground)
    for filled in (chosen.model, chosen.truth, chosen.good):  # the text of a checked button
        assert theme.contrast(chosen.background, filled) >= 4.5
    colours = chosen.colours.values()
    assert len({QColor(colour).rgb() for colour in colours}) == len(colours)


def test_the_choice_is_put_on_with_larger_text_a_tick_that_is_seen_and_maps_on_its_ground(
    qtbot: QtBot, own_look: QApplication
) -> None:
    for choice, chosen in (("dark", theme.DARK), ("light", theme.LIGHT)):
        theme.apply_theme(own_look, choice, 150)  # type: ignore[arg-type]
        assert theme.present == replace(chosen, scale=1.5)
        assert chosen.panel in own_look.styleSheet()
        assert own_look.palette().window().color() == QColor(chosen.background)
        box = QCheckBox("tick")
        qtbot.addWidget(box)
        box.setChecked(True)
        image = picture(box)
        width = int(22 * image.devicePixelRatio())
        seen = {image.pixelColor(x, y).rgb() for x in range(width) for y in range(image.height())}
        assert QColor(chosen.text).rgb() in seen  # the box is filled
        assert QColor(chosen.background).rgb() in seen  # and the tick stands out from it
        box.setChecked(False)
        assert picture(box) != image
        for made, ground_at in ((level_map, 0.0), (share_map, 0.0), (error_map, 0.5), (displacement_map, 0.5)):
            ground, much = made().map([ground_at, 1.0], mode="qcolor")
            assert theme.contrast(ground.name(), chosen.panel) < 1.25
            assert theme.contrast(much.name(), chosen.panel) > 3


def test_plots_take_on_another_theme_and_come_back(
    qtbot: QtBot, own_look: QApplication, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(pg.CONFIG_OPTIONS, "foreground", theme.FAINT)
    view = WaveformPanel(Session(), Library([]))
    qtbot.addWidget(view)
    sources = ("model", "truth", "difference", "preset:other")
    view.set_sources(tuple(ShownSource(source, "A", source, source == "truth") for source in sources))
    item, line = view.plot.getPlotItem(), view.plot.horizon
    curves = item.listDataItems()
    alphas = [curve.opts["pen"].color().alpha() for curve in curves]
    assert sorted(alphas)[-1] == 255 > sorted(alphas)[-2], "the source that is heard has its full colour"
    (shade,) = (each for each in item.items if isinstance(each, pg.LinearRegionItem))
    stranger = pg.PlotDataItem(pen=pg.mkPen("#123456"))
    view.plot.addItem(stranger)
    for old, new in ((theme.DARK, theme.LIGHT), (theme.LIGHT, theme.DARK)):
        theme.use(new)
        recolour(old, new)
        colours = (new.model, new.truth, new.difference, new.other)
        for curve, colour, alpha in zip(curves, colours, alphas, strict=True):
            assert curve.opts["pen"].color() == theme.translucent(colour, alpha)
        assert line.pen.color() == line.label.color == QColor(new.warning)
        assert line.label.fill.color() == theme.translucent(new.panel, 170)
        assert shade.brush.color() == theme.translucent(new.warning, 18)
        assert view.plot.backgroundBrush().color() == QColor(new.panel)
        assert item.getAxis("left").textPen().color() == QColor(new.faint)
        assert stranger.opts["pen"].color() == QColor("#123456")
