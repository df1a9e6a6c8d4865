"""Eigenvalues and partials in the window: the views of a preset and of a take, and which mode is heard alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.views import theme
from app.views.theme import apply_theme
from app.window.controller import Controller

LEFT = Qt.MouseButton.LeftButton


def view(controller: Controller, key: str) -> Any:
    """The view of a panel, brought to the front."""
    controller.session.update(left_view=key)
    return next(panel for panel in controller.panels if panel.key == key)


@pytest.fixture
def eigenvalues(controller: Controller, qtbot: QtBot) -> Any:
    shown = view(controller, "eigenvalues")
    qtbot.waitUntil(lambda: len(shown.plane._places) > 0)
    shown.grab()  # axes take their final room when they are first painted
    return shown


@pytest.fixture
def partials(controller: Controller, qtbot: QtBot) -> Any:
    shown = view(controller, "partials")
    qtbot.waitUntil(lambda: len(shown.table.rows) == 10)
    return shown


def plane_point(plane: Any, point: int) -> Any:
    from PySide6.QtCore import QPointF

    return QPointF(*plane._places[point])


def test_a_point_reports_its_mode_and_a_click_lets_it_be_heard_alone(
    qtbot: QtBot, controller: Controller, eigenvalues: Any
) -> None:
    plane, session = eigenvalues.plane, controller.session

    def place() -> Any:  # where the point is now: axes may still take their room
        return plane.mapFromScene(plane.getPlotItem().vb.mapViewToScene(plane_point(plane, 2)))

    def nearest() -> bool:
        qtbot.mouseMove(plane.viewport(), place() + QPoint(40, 0))
        qtbot.mouseMove(plane.viewport(), place())
        return "nearest to mode 3" in eigenvalues.words

    qtbot.waitUntil(nearest)
    at = place()
    assert "cents" in eigenvalues.words
    assert "T60" in eigenvalues.words
    qtbot.mouseClick(plane.viewport(), LEFT, pos=at)
    assert session.choices.solo == 3
    qtbot.mouseClick(plane.viewport(), LEFT, pos=at)
    assert session.choices.solo == 0


def test_eigenvalues_take_the_colours_of_another_theme(
    controller: Controller, eigenvalues: Any, qapp: QApplication
) -> None:
    def colours() -> tuple[str, str]:
        plane = eigenvalues.plane
        return plane._learned.points()[0].pen().color().name(), plane._string.points()[0].brush().color().name()

    try:
        apply_theme(qapp, "light")
        assert colours() == (theme.MODEL.lower(), theme.TRUTH.lower())
    finally:
        apply_theme(qapp, "dark")
    assert colours() == (theme.MODEL.lower(), theme.TRUTH.lower())


def test_eigenvalues_by_keyboard(qtbot: QtBot, controller: Controller, eigenvalues: Any) -> None:
    plane, session = eigenvalues.plane, controller.session
    plane.setFocus()
    qtbot.keyClick(plane, Qt.Key.Key_Right)
    assert "mode 1" in eigenvalues.words.lower()
    qtbot.keyClick(plane, Qt.Key.Key_Return)
    assert session.choices.solo == 1
    assert "Mode 1 is soloed" in eigenvalues.words
    qtbot.keyClick(plane, Qt.Key.Key_Escape)
    assert session.choices.solo == 0


def test_both_kinds_of_axes_show_every_point(controller: Controller, eigenvalues: Any) -> None:
    plane = eigenvalues.plane
    musical = plane._places.copy()
    eigenvalues._axes.setCurrentIndex(1)
    eigenvalues._axes.activated.emit(1)
    assert plane._places.shape == musical.shape
    assert (np.hypot(*plane._places.T) <= 1).all()
    (left, right), (bottom, top) = plane.getPlotItem().viewRange()
    assert (left <= plane._places[:, 0]).all() and (plane._places[:, 0] <= right).all()
    assert (bottom <= plane._places[:, 1]).all() and (plane._places[:, 1] <= top).all()


def test_partials_of_the_take_and_their_windows(qtbot: QtBot, controller: Controller, partials: Any) -> None:
    trained = {row.key: row.values for row in partials.table.rows}
    assert trained[1][1] == pytest.approx(247, abs=5)
    partials._window.setCurrentIndex(1)
    partials._window.activated.emit(1)
    past = {row.key: row.values for row in partials.table.rows}
    assert past != trained
    assert [row.key for row in partials.table.rows if row.grey]  # above half the rate, at least
    controller.session.update(position=0.5)
    qtbot.waitUntil(lambda: "60 dB" in {r.key: r.values for r in partials.table.rows}[2][-1])


def test_a_row_lets_its_mode_be_heard_alone(qtbot: QtBot, controller: Controller, partials: Any) -> None:
    table, session = partials.table, controller.session
    place = table.visualRect(table.model().index(3, 1)).center()
    qtbot.mouseClick(table.viewport(), LEFT, pos=place)
    assert session.choices.solo == 4
    session.update(solo=2)
    assert table.chosen_key == 2
    qtbot.keyClick(table, Qt.Key.Key_Return)
    assert session.choices.solo == 0
    assert table.chosen_key is None


def test_partials_of_the_pluck_before_are_grey(qtbot: QtBot, controller: Controller, partials: Any) -> None:
    def colours() -> set[str]:
        model = partials.table.model()
        role = Qt.ItemDataRole.ForegroundRole
        return {model.index(0, column).data(role).color().name() for column in range(3)}

    assert len(colours()) > 1
    controller.session.update(position=0.6)
    qtbot.waitUntil(lambda: colours() == {theme.FAINT.lower()})
    qtbot.waitUntil(lambda: len(colours()) > 1)


def test_the_words_of_a_measuring_go(qtbot: QtBot, controller: Controller, partials: Any) -> None:
    assert partials.progress.share is None
    controller.session.update(position=0.45)
    qtbot.waitUntil(lambda: partials._words.text() != "")
    qtbot.waitUntil(lambda: partials._words.text() == "")
