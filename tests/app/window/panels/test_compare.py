"""The table of presets in the window."""

from __future__ import annotations

import shutil
from pathlib import Path
from threading import Event
from typing import Any

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from app.window.controller import Controller
from app.window.panels import compare as module


@pytest.fixture
def shown(qtbot: QtBot, controller: Controller) -> Any:
    controller.session.update(right_view="compare")
    view = next(panel for panel in controller.panels if panel.key == "compare")
    qtbot.waitUntil(lambda: bool(view.table.rows))  # type: ignore[attr-defined]
    return view


def figures(shown: Any) -> dict[object, tuple[Any, ...]]:
    return {row.key: row.values for row in shown.table.rows}


def is_computed(shown: Any, names: set[str]) -> bool:
    rows = shown.table.rows
    return {row.key for row in rows if not row.grey and row.values[1] is not None} == names


def test_presets_of_the_same_string_are_compared(qtbot: QtBot, controller: Controller, shown: Any) -> None:
    qtbot.waitUntil(lambda: is_computed(shown, {"first", "second"}))
    assert figures(shown)["first"][1] == figures(shown)["second"][1]
    assert [row.bold for row in shown.table.rows if row.key == "first"] == [True]
    before = figures(shown)["first"][1]
    controller.session.update(position=0.6)
    qtbot.waitUntil(lambda: all(row.grey for row in shown.table.rows))
    qtbot.waitUntil(lambda: is_computed(shown, {"first", "second"}))
    assert figures(shown)["first"][1] != before


def test_the_preset_on_screen_is_computed_first_and_what_is_in_a_slot_next(
    qtbot: QtBot, controller: Controller, shown: Any
) -> None:
    panel = next(panel for panel in controller.panels if panel.key == "compare")
    qtbot.waitUntil(lambda: is_computed(shown, {"first", "second"}))
    order: list[str] = []
    panel.background.progressed.connect(  # type: ignore[attr-defined]
        lambda share, text, row: order.append(row.name) if row is not None else None
    )
    controller.session.update(preset="second", position=0.6)
    qtbot.waitUntil(lambda: order == ["second", "first"])


def test_a_preset_that_comes_is_in_the_menu(controller: Controller, shown: Any, preset_folder: Path) -> None:
    shutil.copy(preset_folder / "first.safetensors", preset_folder / "third.safetensors")
    controller.library.refresh()
    assert set(shown._actions) == {"first", "second", "third"}


def test_a_row_reports_its_whole_name_and_its_file(shown: Any) -> None:
    row = next(row for row in shown.table.rows if row.key == "second")
    assert row.tip.splitlines() == [row.values[0], "second.safetensors"]


def test_figures_of_an_earlier_pluck_are_reported(qtbot: QtBot, controller: Controller, shown: Any) -> None:
    qtbot.waitUntil(lambda: is_computed(shown, {"first", "second"}))
    assert shown._words.text() == "2 presets on this pluck, 0.5 s"
    controller.session.update(position=0.6)
    qtbot.waitUntil(lambda: shown._words.text() == "0 of 2 presets on this pluck, 0.5 s; grey: an earlier pluck")


def test_a_pluck_that_comes_back_while_it_is_computed_is_computed(
    qtbot: QtBot, controller: Controller, shown: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    qtbot.waitUntil(lambda: is_computed(shown, {"first", "second"}))
    begun: list[object] = []
    compare, held = module.compare, Event()

    def slow(missing: Any, trial: Any, job: Any) -> object:
        begun.append(trial)
        while not held.wait(0.01):
            job.check()
        return compare(missing, trial, job)

    monkeypatch.setattr(module, "compare", slow)
    controller.session.update(position=0.6)
    qtbot.waitUntil(lambda: len(begun) == 1)
    controller.session.update(position=0.61)
    controller.session.update(position=0.6)
    held.set()
    qtbot.waitUntil(lambda: is_computed(shown, {"first", "second"}))


def test_presets_are_taken_out_and_put_in(qtbot: QtBot, controller: Controller, shown: Any) -> None:
    shown._actions["second"].trigger()
    assert list(figures(shown)) == ["first"]
    shown._actions["second"].trigger()
    assert set(figures(shown)) == {"first", "second"}
    shown.table.choose("first")
    qtbot.keyClick(shown.table, Qt.Key.Key_Delete)
    assert list(figures(shown)) == ["second"]
    assert not shown._actions["first"].isChecked()
    shown._menu.actions()[1].trigger()  # all
    assert set(figures(shown)) == {"first", "second"}


def test_enter_loads_a_preset(qtbot: QtBot, controller: Controller, shown: Any) -> None:
    shown.table.setFocus()
    shown.table.choose("second")
    qtbot.keyClick(shown.table, Qt.Key.Key_Return)
    assert controller.session.choices.preset == "second"
    qtbot.waitUntil(lambda: [row.bold for row in shown.table.rows if row.key == "second"] == [True])


def test_a_bad_preset_is_a_row_with_the_reason(
    qtbot: QtBot, controller: Controller, shown: Any, preset_folder: Path
) -> None:
    damaged = preset_folder / "damaged"
    damaged.write_bytes(b"damaged")
    damaged.replace(preset_folder / "second.safetensors")  # not in place: another thread may be reading the old one
    controller.session.update(amplitude_mm=controller.session.choices.amplitude_mm + 0.5)  # or have read it
    qtbot.waitUntil(lambda: "second.safetensors" in figures(shown)["second"][-1])
    assert is_computed(shown, {"first"})


def test_it_is_stopped_and_goes_on(qtbot: QtBot, controller: Controller, shown: Any) -> None:
    panel = next(panel for panel in controller.panels if panel.key == "compare")
    qtbot.waitUntil(lambda: panel.background.busy)  # type: ignore[attr-defined]
    qtbot.mouseClick(shown._stop, Qt.MouseButton.LeftButton)
    assert shown.progress.share is None
    assert not panel.background.busy  # type: ignore[attr-defined]
    qtbot.mouseClick(shown._stop, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: is_computed(shown, {"first", "second"}))
