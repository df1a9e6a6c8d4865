from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from app.window.controller import Controller
from engine.presets.finding import SHIPPED


@pytest.fixture
def played(
    qtbot: QtBot, preset_folder: Path, controller: Controller, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Controller:
    """A window with a patch, and the preset that plays it."""
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    shutil.copy(SHIPPED / "studio_any_string.safetensors", preset_folder)
    controller.library.refresh()
    controller.patches.choose("steel_string_acoustic")
    qtbot.waitUntil(lambda: controller.performance.notes.keys.player is not None)
    controller.session.update(face="play")
    controller.window.setFocus()
    return controller
