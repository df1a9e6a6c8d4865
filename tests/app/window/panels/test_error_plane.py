"""The map of errors in the window: a picture, what is pointed at, and a pluck where it is clicked."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QPointF, Qt
from pytestqt.qtbot import QtBot

from app.analysis import error_plane
from app.analysis.error_plane import AMPLITUDES_MM, POSITIONS
from app.window.controller import Controller
from engine.pluck import Pluck


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Pluck]:
    """The plucks that were computed, quickly."""
    plucks: list[Pluck] = []

    def fake(preset: Any) -> Any:
        def errors(some: list[Pluck], job: Any) -> Any:
            plucks.extend(some)
            return np.full(len(some), 0.05 if some[0].shape == "gaussian" else math.inf)

        return errors

    monkeypatch.setattr(error_plane, "error_of_plucks", fake)
    return plucks


@pytest.fixture
def shown(qtbot: QtBot, asked: list[Pluck], controller: Controller) -> Any:
    controller.session.update(left_view="error_plane")
    view = next(panel for panel in controller.panels if panel.key == "error_plane")
    qtbot.waitUntil(lambda: view._picture is not None and view._picture.spacing == 1)
    return view


def test_a_click_plucks_there(qtbot: QtBot, controller: Controller, shown: Any) -> None:
    plane = shown.map
    at = plane.mapFromScene(plane.getPlotItem().vb.mapViewToScene(QPointF(0.6, math.log10(8))))
    qtbot.mouseMove(plane.viewport(), at)
    qtbot.waitUntil(lambda: "Pluck at 0.60" in shown.words)
    assert "error as trained about 5 %" in shown.words
    qtbot.mouseClick(plane.viewport(), Qt.MouseButton.LeftButton, pos=at)
    choices = controller.session.choices
    assert choices.position == pytest.approx(0.6, abs=0.01)
    assert choices.amplitude_mm == pytest.approx(8, rel=0.05)
    qtbot.waitUntil(lambda: shown.map._present == (choices.position, choices.amplitude_mm))
    assert choices.position == round(choices.position, 3)  # no more digits than can be read
    qtbot.waitUntil(lambda: controller.performance.playing)


def test_arrows_move_a_cursor_and_enter_plucks(qtbot: QtBot, controller: Controller, shown: Any) -> None:
    plane = shown.map
    plane.setFocus()
    before = controller.session.choices
    for key in (Qt.Key.Key_Right, Qt.Key.Key_Up, Qt.Key.Key_Up):
        qtbot.keyClick(plane, key)
    x, y = error_plane.nearest_cell(before.position, before.amplitude_mm)
    assert plane.cursor == (POSITIONS[x + 1], AMPLITUDES_MM[y + 2])
    assert controller.session.choices == before
    qtbot.keyClick(plane, Qt.Key.Key_Return)
    assert controller.session.choices.position == pytest.approx(POSITIONS[x + 1], abs=5e-4)
    qtbot.keyClick(plane, Qt.Key.Key_Escape)
    assert plane.cursor is None


def test_beyond_the_training_is_reported(shown: Any) -> None:
    plane = shown.map
    plane._point_at((0.5, 5.0))
    assert "outside" not in shown.words
    plane._point_at((0.1, 5.0))
    assert "outside the training range" in shown.words
    plane._point_at((0.5, 15.0))
    assert "outside the training range" in shown.words


def test_any_range_of_amplitudes_is_drawn(shown: Any) -> None:
    """A preset may tell that it was trained from no amplitude on, or beyond the map."""
    for trained_mm in ((0.0, 20.0), (1e-9, 1e9), (0.0, 0.0)):
        shown.map.set_trained((0.1, 0.9), lambda _, trained_mm=trained_mm: trained_mm)
    assert not shown.map.is_trained(0.5, 3.0)


def test_trained_amplitudes_may_depend_on_the_place(shown: Any) -> None:
    """As where plucks were scaled to a rise of tension, which one near an end reaches with less."""
    shown.map.set_trained((0.1, 0.9), lambda place: (0.0, 20 * place))
    assert shown.map.is_trained(0.5, 9.9)
    assert shown.map.is_trained(0.5, 1e-3)
    assert not shown.map.is_trained(0.2, 9.9)
    places, levels = shown.map._outline.getData()
    highest = {place: max(levels[places == place]) for place in places}
    assert 10 ** highest[0.1] == pytest.approx(2.0)
    assert 10 ** highest[0.5] == pytest.approx(10.0)


def test_another_shape_is_another_map_and_returning_computes_nothing(
    qtbot: QtBot, controller: Controller, shown: Any, asked: list[Pluck]
) -> None:
    count = len(asked)
    assert count == len(POSITIONS) * len(AMPLITUDES_MM)
    controller.session.update(shape="triangular")
    assert shown._picture is None
    qtbot.waitUntil(lambda: len(asked) == 2 * count and shown.progress.share is None)
    shown.map._point_at((0.5, 5.0))
    assert "diverges" in shown.words
    controller.session.update(shape="gaussian")
    qtbot.waitUntil(lambda: shown._picture is not None and shown.progress.share is None)
    assert len(asked) == 2 * count
    controller.session.update(preset="second")  # the same file under another name
    qtbot.waitUntil(lambda: shown._picture is not None and shown.progress.share is None)
    assert len(asked) == 2 * count
