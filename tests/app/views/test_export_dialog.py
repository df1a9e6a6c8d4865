"""The export dialog: what it writes, remembers, and says when it cannot."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import soundfile
from pytestqt.qtbot import QtBot

from app.library import list_presets
from app.session import Choices
from app.settings import ExportChoices
from app.views.export_dialog import ExportDialog


@pytest.fixture
def dialog(qtbot: QtBot, small_preset: Path, tmp_path: Path) -> ExportDialog:
    folder = tmp_path / "presets"
    folder.mkdir()
    shutil.copy(small_preset, folder)
    (entry,), _ = list_presets(folder)
    made = ExportDialog(
        entry, Choices(preset="small", position=0.4), ExportChoices(folder=str(tmp_path), rate_hz=0, seconds=0.5)
    )
    qtbot.addWidget(made)
    made.show()
    return made


def test_it_writes_the_file_that_it_named(qtbot: QtBot, dialog: ExportDialog, tmp_path: Path) -> None:
    dialog._save.click()
    qtbot.waitUntil(lambda: "Saved" in dialog._state.text(), timeout=10_000)
    path = tmp_path / "small_x0.40_a4.0_4000_model.wav"
    assert str(path) in dialog._state.text()
    assert "past the model's training" in dialog._state.text()
    info = soundfile.info(path)
    assert (info.samplerate, info.frames, info.subtype) == (4000, 2000, "PCM_24")
    assert [p.name for p in tmp_path.glob("*.wav")] == [path.name]


def test_a_folder_that_is_not_there_is_told(qtbot: QtBot, dialog: ExportDialog, tmp_path: Path) -> None:
    dialog._path.setText(str(tmp_path / "nowhere" / "x.wav"))
    dialog._save.click()
    qtbot.waitUntil(lambda: "nowhere" in dialog._state.text(), timeout=10_000)
    assert "make the folder first" in dialog._state.text()
    assert dialog._save.isEnabled()


def test_cancel_leaves_nothing(qtbot: QtBot, dialog: ExportDialog, tmp_path: Path) -> None:
    dialog._seconds.setValue(600)
    dialog._save.click()
    dialog._close.click()
    qtbot.waitUntil(lambda: "Cancelled" in dialog._state.text(), timeout=30_000)
    assert list(tmp_path.glob("*.wav")) == []
    assert list(tmp_path.glob(".*")) == []


def test_its_state_is_remembered(dialog: ExportDialog, tmp_path: Path) -> None:
    dialog._source.setCurrentIndex(dialog._source.findData("difference"))
    assert "difference.wav" in dialog._path.text()
    choices = dialog.export_choices()
    assert (choices.source, choices.folder, choices.seconds) == ("difference", str(tmp_path), 0.5)
