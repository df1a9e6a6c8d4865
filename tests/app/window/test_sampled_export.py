"""The patch exported from the window, which continues playing."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import soundfile
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.export.sampled.choices import SampledChoices
from app.export.sampled.plan import SampledPlan
from app.patches.library import find_patch
from app.shared.worker import Cancelled
from app.views.dialogs.export_dialog import ExportDialog
from app.window.controller import Controller
from app.window.settings import load_settings
from engine.presets.finding import SHIPPED
from tests.app.questions import answered

PATCH = "Classical guitar"


@pytest.fixture
def patched(controller: Controller, preset_folder: Path, tmp_path: Path) -> Controller:
    """With a patch, and choices that are soon rendered."""
    shutil.copy(SHIPPED / "studio_any_string.safetensors", preset_folder)
    controller.library.refresh()
    sampled = SampledChoices(folder=str(tmp_path), keys=(60, 61), layers=1, seconds=0.2)
    controller.exports._choices = controller.exports.choices[0], sampled
    controller.session.update(instrument=find_patch(PATCH).patch)
    return controller


def open_dialog(qtbot: QtBot, controller: Controller):
    controller.window.activateWindow()
    qtbot.keyClick(
        controller.window, Qt.Key.Key_E, Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier
    )
    return controller.exports.dialog


def test_without_a_patch_it_says_so(controller: Controller) -> None:
    controller.session.update(patch=None)
    controller.window.action["sampler"].trigger()
    assert controller.exports.dialog is None
    assert "There is no instrument to export" in controller.window.notices.notices[-1].message


def test_the_patch_is_exported_while_the_window_plays(qtbot: QtBot, patched: Controller, tmp_path: Path) -> None:
    dialog = open_dialog(qtbot, patched)
    assert dialog.isVisible()
    assert not dialog.isModal()
    open_dialog(qtbot, patched)
    assert patched.exports.dialog is dialog
    assert dialog.sampler.what.text().startswith(PATCH)
    patched.session.update(instrument=find_patch("Concert harp").patch)
    assert dialog.sampler.what.text().startswith("Concert harp")
    qtbot.waitUntil(lambda: patched.performance.notes.keys.player is not None)
    dialog.save.click()
    qtbot.keyPress(patched.window, Qt.Key.Key_A)
    qtbot.waitUntil(lambda: bool(patched.performance.notes.keys.sounding()))
    qtbot.keyRelease(patched.window, Qt.Key.Key_A)
    qtbot.waitUntil(lambda: "Saved" in dialog.state.text())
    assert "Concert_harp.sfz" in dialog.state.text()
    samples = sorted((tmp_path / "Concert_harp_samples").glob("*.flac"))
    plan = SampledPlan(find_patch("Concert harp").patch, (60, 61), layers=1)
    assert [path.stem for path in samples] == [zone.stem for zone in plan.zones]
    assert soundfile.info(samples[0]).frames == 9_600


@pytest.fixture
def exporting(qtbot: QtBot, patched: Controller, monkeypatch: pytest.MonkeyPatch) -> ExportDialog:
    """Its dialog, which had the focus when the export began; it ends when it is cancelled."""
    begun = threading.Event()

    def export(plan, out, render, progress):
        begun.set()
        while True:
            progress(0.0)
            time.sleep(0.01)

    monkeypatch.setattr("app.export.sampled.export.export_sampled", export)
    qtbot.waitUntil(lambda: patched.performance.notes.keys.player is not None)
    dialog = open_dialog(qtbot, patched)
    qtbot.waitUntil(dialog.isActiveWindow)
    qtbot.mouseClick(dialog.save, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(begun.is_set)
    return dialog


def test_keys_play_and_shortcuts_work_while_it_runs(
    qtbot: QtBot, patched: Controller, exporting: ExportDialog
) -> None:
    """Without a click."""
    qtbot.waitUntil(patched.window.isActiveWindow)
    active = QApplication.activeWindow()
    assert active is not None
    focused = active.focusWidget() or active
    qtbot.keyPress(focused, Qt.Key.Key_A)
    qtbot.waitUntil(lambda: bool(patched.performance.notes.keys.sounding()))
    qtbot.keyRelease(focused, Qt.Key.Key_A)
    looped = patched.session.choices.loop
    qtbot.keyClick(focused, Qt.Key.Key_L, Qt.KeyboardModifier.ControlModifier)
    assert patched.session.choices.loop != looped
    with answered("Cancel export"):
        qtbot.keyClick(focused, Qt.Key.Key_Q, Qt.KeyboardModifier.ControlModifier)
    assert not patched.window.isVisible()


def test_escape_in_the_dialog_asks_whether_to_cancel(
    qtbot: QtBot, patched: Controller, exporting: ExportDialog
) -> None:
    exporting.activateWindow()
    qtbot.waitUntil(exporting.isActiveWindow)
    patched.session.update(solo=2)
    with answered("Cancel export"):
        qtbot.keyClick(exporting.focusWidget() or exporting, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: "Cancelled" in exporting.state.text())
    assert patched.session.choices.solo == 2
    looped = patched.session.choices.loop
    qtbot.keyClick(exporting.sampler, Qt.Key.Key_L, Qt.KeyboardModifier.ControlModifier)
    assert patched.session.choices.loop == looped  # its own keys again


def test_what_was_chosen_is_remembered(qtbot: QtBot, patched: Controller, tmp_path: Path) -> None:
    dialog = open_dialog(qtbot, patched)
    dialog.sampler.layers.setValue(7)
    assert patched.settings().sampled.layers == 7  # should the process be killed now
    dialog.close()
    assert patched.exports.dialog is None
    assert open_dialog(qtbot, patched).sampler.layers.value() == 7
    patched.window.close()
    remembered = load_settings(tmp_path / "settings.json")[0].sampled
    assert (remembered.layers, remembered.keys, remembered.folder) == (7, (60, 61), str(tmp_path))


def test_closing_the_window_ends_it_where_the_user_says_so(
    qtbot: QtBot, patched: Controller, monkeypatch: pytest.MonkeyPatch, threads_begun: Callable[[], list[str]]
) -> None:
    begun, ended = threading.Event(), threading.Event()

    def export(plan, out, render, progress):
        begun.set()
        try:
            while True:
                progress(0.0)
                time.sleep(0.01)
        except Cancelled:
            ended.set()
            raise ValueError("shown to nobody") from None

    monkeypatch.setattr("app.export.sampled.export.export_sampled", export)
    dialog = open_dialog(qtbot, patched)
    dialog.save.click()
    assert begun.wait(60)
    with answered(Qt.Key.Key_Return):
        patched.window.close()
    assert patched.window.isVisible() and not ended.is_set()
    with answered("Cancel export"):
        patched.window.close()
    assert ended.is_set()
    assert threads_begun() == []
