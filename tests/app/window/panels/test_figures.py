"""Eigenvalues, partials, the map of errors and the table of presets, in the Lab: read, pointed at and chosen from."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pyqtgraph as pg
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QComboBox, QToolButton

from app.analysis import error_plane
from app.analysis.error_plane import AMPLITUDES_MM, POSITIONS
from app.views import theme
from app.views.controls.elided_label import ElidedLabel
from app.window.panels import compare
from engine.pluck import Pluck
from tests.app.window.driver import KEY, LEFT, choose, find, press
from tests.app.window.panels.conftest import at, items

LEARNED, STRING, PLUCK = 13, 6, 13  # pixels of the points


def points(plot: pg.PlotWidget, size: int) -> np.ndarray:
    """The places of a plot's points of this size, (points, 2)."""
    (found,) = (each for each in items(plot, pg.ScatterPlotItem) if each.opts["size"] == size)
    return np.stack(found.getData(), axis=1)


def words_of(panel: Any) -> str:
    return panel.findChild(ElidedLabel).text()


def test_eigenvalues_are_pointed_at_and_heard_alone_by_mouse_and_keyboard(lab):
    panel = lab.panel("eigenvalues")
    plane = panel.plane
    lab.wait(lambda: len(points(plane, LEARNED)) > 0)
    panel.grab()  # axes take their final room when they are first painted

    def nearest() -> bool:
        place = at(plane, *points(plane, LEARNED)[2])
        for pixel in (place + QPoint(40, 0), place):
            lab.qtbot.mouseMove(plane.viewport(), pixel)
        return "nearest to mode 3" in panel.words

    lab.wait(nearest)
    assert "cents" in panel.words and "T60" in panel.words
    for solo in (3, 0):
        lab.qtbot.mouseClick(plane.viewport(), LEFT, pos=at(plane, *points(plane, LEARNED)[2]))
        assert lab.choices.solo == solo
    plane.setFocus()
    lab.key(KEY.Key_Escape, on=plane)
    lab.qtbot.mouseMove(plane.viewport(), QPoint(1, 1))
    for key, solo, words in (
        (KEY.Key_Right, 0, "ode 1"),
        (KEY.Key_Return, 1, "Mode 1 is soloed"),
        (KEY.Key_Escape, 0, ""),
    ):
        lab.key(key, on=plane)
        assert lab.choices.solo == solo and words in panel.words
    lab.qtbot.mouseDClick(plane.viewport(), LEFT, pos=QPoint(1, 1))
    choose(find(panel, QComboBox, "Axes"), "complex")
    low, high = plane.getPlotItem().vb.viewRange()[1]
    for size in (LEARNED, STRING):
        places = points(plane, size)
        assert (np.hypot(*places.T) < 1).all() and (low <= places[:, 1]).all() and (places[:, 1] <= high).all()


def test_partials_of_a_pluck_are_measured_greyed_and_heard_alone(lab):
    panel = lab.panel("partials")
    table = panel.table
    lab.wait(lambda: len(table.rows) == 10)

    def rows() -> dict[object, tuple[Any, ...]]:
        return {row.key: row.values for row in table.rows}

    def colours() -> set[str]:
        role = Qt.ItemDataRole.ForegroundRole
        return {table.model().index(0, column).data(role).color().name() for column in range(3)}

    trained = rows()
    assert trained[1][1] == pytest.approx(247, abs=5)
    assert panel.progress.share is None and len(colours()) > 1
    window = find(panel, QComboBox, "Window of time")
    window.setCurrentIndex(1)
    window.activated.emit(1)
    assert rows() != trained and any(row.grey for row in table.rows), "above half the rate, at least"
    lab.qtbot.mouseClick(table.viewport(), LEFT, pos=table.visualRect(table.model().index(3, 1)).center())
    assert lab.choices.solo == 4
    lab.change(solo=2)
    assert table.chosen_key == 2
    lab.key(KEY.Key_Return, on=table)
    assert (lab.choices.solo, table.chosen_key) == (0, None)
    lab.change(position=0.5)
    lab.wait(lambda: words_of(panel) != "" and colours() == {theme.FAINT.lower()})
    lab.wait(lambda: words_of(panel) == "" and len(colours()) > 1)
    assert "60 dB" in rows()[2][-1], "a pluck in the middle has no second mode"


@pytest.fixture
def asked(monkeypatch) -> list[Pluck]:
    """The plucks of which errors were computed, quickly."""
    plucks: list[Pluck] = []

    def errors_of(some: list[Pluck], job: Any) -> Any:
        plucks.extend(some)
        return np.full(len(some), 0.05 if some[0].shape == "gaussian" else math.inf)

    monkeypatch.setattr(error_plane, "error_of_plucks", lambda preset: errors_of)
    return plucks


def test_the_map_of_errors_is_computed_once_and_plucked_in(asked, lab):
    panel = lab.panel("error_plane")
    plane, count = panel.map, len(POSITIONS) * len(AMPLITUDES_MM)

    def computed(times: int) -> None:
        lab.key(KEY.Key_Escape, on=plane)  # the words are those of the map again
        lab.wait(lambda: "a click plucks there" in panel.words and panel.progress.share is None)
        assert len(asked) == times * count

    def point(position: float, amplitude_mm: float) -> QPoint:
        place = at(plane, position, math.log10(amplitude_mm))
        lab.qtbot.mouseMove(plane.viewport(), place + QPoint(3, 0))
        lab.qtbot.mouseMove(plane.viewport(), place)
        return place

    computed(1)
    panel.grab()
    for position, amplitude_mm, outside in ((0.5, 5.0, False), (0.1, 5.0, True), (0.5, 15.0, True)):
        point(position, amplitude_mm)
        lab.wait(lambda words=f"Pluck at {position:.2f}": words in panel.words)
        assert ("outside the training range" in panel.words) == outside
    plane.hovered.emit(math.nan, math.nan)  # the pointer has left
    assert plane.cursor is None
    lab.qtbot.mouseClick(plane.viewport(), LEFT, pos=point(0.6, 8.0))
    assert lab.choices.pluck.position == pytest.approx(0.6, abs=0.01) == round(lab.choices.pluck.position, 3)
    assert lab.choices.pluck.amplitude_mm == pytest.approx(8, rel=0.05)
    lab.wait(lambda: lab.performance.playing)
    here = [lab.choices.pluck.position, math.log10(lab.choices.pluck.amplitude_mm)]
    lab.wait(lambda: points(plane, PLUCK)[0].tolist() == pytest.approx(here))
    lab.key(KEY.Key_Escape, on=plane)
    before, (x, y) = lab.choices, error_plane.nearest_cell(lab.choices.pluck.position, lab.choices.pluck.amplitude_mm)
    for key in (KEY.Key_Left, KEY.Key_Down, KEY.Key_Down):
        lab.key(key, on=plane)
    assert plane.cursor == (POSITIONS[x - 1], AMPLITUDES_MM[y - 2]) and lab.choices == before
    lab.key(KEY.Key_Return, on=plane)
    assert lab.choices.pluck.position == pytest.approx(POSITIONS[x - 1], abs=5e-4)
    lab.change(shape="triangular")
    assert "a click plucks there" not in panel.words
    computed(2)
    point(0.5, 5.0)
    lab.wait(lambda: "diverges" in panel.words)
    lab.key(KEY.Key_Escape, on=plane)


def figures(panel: Any) -> dict[object, tuple[Any, ...]]:
    return {row.key: row.values for row in panel.table.rows}


def computed(panel: Any) -> set[object]:
    """The presets with figures of the present pluck."""
    return {row.key for row in panel.table.rows if not row.grey and row.values[1] is not None}


def menu_of(panel: Any) -> list[QAction]:
    return find(panel, QToolButton, "Presets to compare").menu().actions()


def test_presets_are_compared_and_exported(lab, tmp_path, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(compare, "compare", lambda _, job: (job.report(0.5), job.wait(60.0)))
        lab.window.action["models"].trigger()
        panel, both = lab.panel("compare"), {"first", "second"}
        assert lab.choices.right_view == "compare" and panel.table.hasFocus()
        lab.wait(lambda: words_of(panel).endswith(" left"))
        press(panel, "Stop comparing")
    assert panel.progress.share is None and not panel.background.busy and "left" not in words_of(panel)
    press(panel, "Compare again")
    lab.wait(lambda: computed(panel) == both)
    before = figures(panel)
    assert before["first"][1] == before["second"][1]
    assert [row.key for row in panel.table.rows if row.bold] == ["first"]
    assert words_of(panel) == "2 presets on this pluck, 0.5 s"
    export = find(panel, QToolButton, "Export the models")
    export.click()
    dialog = lab.controller.exports.dialog
    assert dialog is not None and "2 models" in dialog.models.what.text()
    for name in ("", "out"):
        dialog.models.file.edit.setText(str(tmp_path / name))
        dialog.models.file.edit.textEdited.emit("")
        lab.wait(lambda name=name: dialog.save.isEnabled() == bool(name))
    dialog.save.click()
    lab.wait(lambda: "Saved" in dialog.state.text())
    assert len(list((tmp_path / "out").glob("*.wav"))) == 6 and (tmp_path / "out" / "models.csv").is_file()
    assert Path(dialog.models.file.edit.text()).name == "out" and not dialog.save.isEnabled(), "a given name stays"
    dialog.accept()
    lab.change(preset="second", position=0.6)
    lab.wait(lambda: all(row.grey for row in panel.table.rows) and not export.isEnabled())
    assert words_of(panel) == "0 of 2 presets on this pluck, 0.5 s; grey: an earlier pluck"
    lab.wait(lambda: computed(panel) == both)
    assert figures(panel)["first"][1] != before["first"][1]
    first = next(each for each in menu_of(panel) if each.isCheckable())
    for left in (["second"], ["second", "first"]):
        first.trigger()
        assert set(figures(panel)) == set(left)
    menu_of(panel)[1].trigger()  # all
    panel.table.setFocus()
    panel.table.choose("first")
    lab.change(a="difference", b="truth", position=0.1)  # outside the training
    pluck = lab.choices.pluck
    lab.key(KEY.Key_Return, on=panel.table)
    assert (lab.choices.preset, lab.choices.source_heard, lab.choices.pluck) == ("first", "model", pluck)
    assert lab.struck[-1].request.pluck == pluck
    place = panel.table.visualItemRect(panel.table.item(1, 0)).center()
    lab.qtbot.mouseClick(panel.table.viewport(), LEFT, pos=place)
    assert (lab.choices.preset, len(lab.struck)) == ("second", 2)
