"""Both themes can be read, and a plot that was made under one takes on the other."""

from __future__ import annotations

from collections.abc import Iterator

import pyqtgraph as pg
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QApplication, QCheckBox, QInputDialog, QLineEdit
from pytestqt.qtbot import QtBot

from app.presets.library import Library
from app.session.choices import Session
from app.session.shown import ShownSource
from app.views import theme
from app.views.plots.colour_maps import level_map, share_map
from app.views.plots.plots import recolour
from app.views.string.view import StringView
from app.window.panels.error_plane import ErrorPlanePanel
from app.window.panels.error_time import ErrorTimePanel
from app.window.panels.space_time import SpaceTimePanel
from app.window.panels.spectrogram import SpectrogramPanel
from app.window.panels.waveform import WaveformPanel


@pytest.fixture
def dark_again() -> Iterator[None]:
    yield
    theme.use(theme.DARK)


def test_a_question_for_a_name_has_room_for_one(qtbot: QtBot) -> None:
    dialog = QInputDialog()
    qtbot.addWidget(dialog)
    dialog.setStyleSheet(theme._style_sheet())
    dialog.setTextValue("Steel-string acoustic, felt, tuned to D")
    dialog.show()
    field = dialog.findChild(QLineEdit)
    assert field.fontMetrics().horizontalAdvance(field.text()) < field.width()


@pytest.mark.parametrize("chosen", [theme.DARK, theme.LIGHT], ids=["dark", "light"])
def test_text_can_be_read_on_every_ground(chosen: theme.Theme) -> None:
    for ground in (chosen.background, chosen.panel, chosen.raised, chosen.ground_top, chosen.ground_bottom):
        for text in (chosen.text, chosen.faint, chosen.model, chosen.truth, chosen.warning, chosen.good):
            assert theme.contrast(text, ground) >= 4.5, (text, ground)
    for filled in (chosen.model, chosen.truth, chosen.good):  # the text of a checked button
        assert theme.contrast(chosen.background, filled) >= 4.5


@pytest.mark.parametrize("chosen", [theme.DARK, theme.LIGHT], ids=["dark", "light"])
def test_no_two_roles_share_a_colour(chosen: theme.Theme) -> None:
    """Else a plot could not know which role to take on."""
    colours = [value for value in vars(chosen).values() if isinstance(value, str)]
    assert len({QColor(colour).rgb() for colour in colours}) == len(colours)


def test_a_checked_box_has_a_tick_that_is_seen(qtbot: QtBot, qapp: QApplication, dark_again: None) -> None:
    style, palette = qapp.styleSheet(), qapp.palette()
    for choice, chosen in (("dark", theme.DARK), ("light", theme.LIGHT)):
        theme.apply_theme(qapp, choice)  # type: ignore[arg-type]
        box = QCheckBox("tick")
        qtbot.addWidget(box)
        box.setChecked(True)
        picture = box.grab().toImage()
        ratio = picture.devicePixelRatio()
        seen = {picture.pixelColor(x, y).rgb() for x in range(int(22 * ratio)) for y in range(picture.height())}
        assert QColor(chosen.text).rgb() in seen  # the box is filled
        assert QColor(chosen.background).rgb() in seen  # and the tick stands out from it
        assert f'stroke="{chosen.background}"' in (theme.SIGNS / f"tick_{choice}.svg").read_text()
        box.setChecked(False)
        assert box.grab().toImage() != picture
    qapp.styleHints().setColorScheme(Qt.ColorScheme.Unknown)
    qapp.setStyleSheet(style)
    qapp.setPalette(palette)


def test_contrast_is_that_of_the_standard() -> None:
    assert theme.contrast("#000000", "#ffffff") == pytest.approx(21)
    assert theme.contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)


def test_the_names_are_those_of_the_present_theme(dark_again: None) -> None:
    theme.use(theme.LIGHT)
    assert (theme.LIGHT.model, theme.LIGHT.text) == (theme.MODEL, theme.TEXT)
    light = theme.LIGHT
    wanted = {"model": light.model, "truth": light.truth, "difference": light.difference, "other": light.other}
    assert wanted == theme.SOURCE_COLOURS


def test_plots_take_on_another_theme_and_come_back(
    qtbot: QtBot, dark_again: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(pg.CONFIG_OPTIONS, "foreground", theme.FAINT)
    view = WaveformPanel(Session(), Library([]))
    qtbot.addWidget(view)
    sources = ("model", "truth", "difference", "preset:other")
    view.set_sources(tuple(ShownSource(source, "A", source, source == "truth") for source in sources))
    line = view.plot.horizon
    faint = view._curves["model"].opts["pen"].color().alpha()
    stranger = pg.PlotDataItem(pen=pg.mkPen("#123456"))
    view.plot.addItem(stranger)
    for old, new in ((theme.DARK, theme.LIGHT), (theme.LIGHT, theme.DARK)):
        theme.use(new)
        recolour(old, new)
        for curve, colour in zip(
            view._curves.values(), (new.model, new.truth, new.difference, new.other), strict=True
        ):
            alpha = 255 if colour == new.truth else faint
            assert curve.opts["pen"].color() == theme.translucent(colour, alpha)
        assert line.pen.color() == QColor(new.warning)
        assert view.plot.horizon.label.color == QColor(new.warning)
        assert view.plot.horizon.label.fill.color() == theme.translucent(new.panel, 170)
        assert view.plot._untrained.brush.color() == theme.translucent(new.warning, 18)
        assert view.plot.backgroundBrush().color() == QColor(new.panel)
        assert view.plot.getPlotItem().getAxis("left").textPen().color() == QColor(new.faint)
        assert stranger.opts["pen"].color() == QColor("#123456")


def test_pictures_lie_on_the_ground_of_the_theme(qtbot: QtBot, dark_again: None) -> None:
    """What is nothing is as light, or as dark, as the panel; what is much is not."""
    spectrogram, space_time, plane = (
        SpectrogramPanel(Session(), Library([])),
        SpaceTimePanel(Session(), Library([])),
        ErrorPlanePanel(Session(), Library([])),
    )
    for widget in (spectrogram, space_time, plane):
        qtbot.addWidget(widget)
    for chosen in (theme.LIGHT, theme.DARK):
        theme.use(chosen)
        for view, ground_at in ((spectrogram, 0.0), (space_time, 0.5), (plane.map, 0.0)):
            colours = view._bar.colorMap()
            ground, much = (colours.map(place, mode="qcolor") for place in (ground_at, 1.0))
            assert theme.contrast(ground.name(), chosen.panel) < 1.25
            assert theme.contrast(much.name(), chosen.panel) > 3
        table = spectrogram._image.lut
        assert theme.contrast(QColor(*map(int, table[0][:3])).name(), chosen.panel) < 1.25


def test_curves_of_errors_have_the_colours_of_the_theme(
    qtbot: QtBot, dark_again: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(pg.CONFIG_OPTIONS, "foreground", theme.FAINT)
    view = ErrorTimePanel(Session(), Library([]))
    qtbot.addWidget(view)
    for old, new in ((theme.DARK, theme.LIGHT), (theme.LIGHT, theme.DARK)):
        theme.use(new)
        recolour(old, new)
        for name, colour in (("rmse", new.model), ("mae", new.difference)):
            assert view._curves[name].opts["pen"].color() == QColor(colour)


def test_a_painted_view_reads_the_theme_when_it_paints(qtbot: QtBot, dark_again: None) -> None:
    view = StringView()
    qtbot.addWidget(view)
    view.resize(600, 260)
    dark = view.grab().toImage().pixelColor(300, 60)
    theme.use(theme.LIGHT)
    light = view.grab().toImage().pixelColor(300, 60)
    assert dark.lightness() < 60 < 200 < light.lightness()


@pytest.mark.parametrize(("choice", "chosen"), [("light", theme.LIGHT), ("dark", theme.DARK)])
def test_the_choice_is_put_on(
    qapp: QApplication, dark_again: None, choice: theme.ThemeChoice, chosen: theme.Theme
) -> None:
    style, palette = qapp.styleSheet(), qapp.palette()
    theme.apply_theme(qapp, choice)
    assert theme.present == chosen
    assert chosen.panel in qapp.styleSheet()
    assert qapp.palette().window().color() == QColor(chosen.background)
    qapp.styleHints().setColorScheme(Qt.ColorScheme.Unknown)
    qapp.setStyleSheet(style)
    qapp.setPalette(palette)


@pytest.mark.parametrize("size_percent", [100, 150])
def test_maps_of_colours_are_those_of_the_theme_at_any_size_of_text(qapp: QApplication, size_percent: int) -> None:
    lightness = {}
    for choice in ("light", "dark"):
        theme.apply_theme(qapp, choice, size_percent)
        for made in (level_map, share_map):
            colours = made().map([0.0, 1.0], mode="qcolor")
            lightness[choice, made] = [colour.lightnessF() for colour in colours]
    theme.apply_theme(qapp, "dark")
    for (choice, _), (zero, most) in lightness.items():
        assert (zero < most) == (choice == "dark")
