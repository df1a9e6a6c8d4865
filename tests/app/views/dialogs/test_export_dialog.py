"""The export dialog: what it writes, remembers, and says when it cannot."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
import soundfile
from PySide6.QtCore import Qt
from PySide6.QtGui import QDesktopServices
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QComboBox, QDoubleSpinBox, QListWidget, QTabBar
from pytestqt.qtbot import QtBot

from app.export.choices import ExportChoices
from app.patches.instrument import SingleString
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from app.presets.library import list_presets
from app.session.choices import Choices
from app.views.dialogs.export_dialog import ExportDialog


@pytest.fixture
def made(qtbot: QtBot, small_preset: Path, tmp_path: Path) -> object:
    """Makes a dialog for two presets, `small` and `other`."""
    folder = tmp_path / "presets"
    folder.mkdir()
    for name in ("small", "other"):
        shutil.copy(small_preset, folder / f"{name}.safetensors")
    entries, _ = list_presets(folder)

    def make(more: dict[str, object] | None = None, heard: dict[str, object] | None = None) -> ExportDialog:
        settings = {"folder": str(tmp_path), "rate_hz": 0, "seconds": 0.5, "until_decayed": False, **(more or {})}
        export = ExportChoices.model_validate(settings)
        choices = Choices(instrument=SingleString(preset="small"), position=0.4).changed(heard or {})
        dialog = ExportDialog(entries, choices, export)
        qtbot.addWidget(dialog)
        dialog.show()
        return dialog

    return make


@pytest.fixture
def dialog(made) -> ExportDialog:
    return made()


def run(qtbot: QtBot, dialog: ExportDialog, words: str) -> None:
    dialog.save.click()
    qtbot.waitUntil(lambda: words in dialog.state.text())


def wavs(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("*.wav"))


def test_it_writes_the_file_that_it_named(
    qtbot: QtBot, dialog: ExportDialog, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not dialog.show_folder.isVisible()
    run(qtbot, dialog, "Saved")
    path = tmp_path / "small_x0.40_a4.0_4000_model.wav"
    for words in (str(path), "dBFS, 0 clipped", "The last 0.40 s lie past the model's training"):
        assert words in dialog.state.text()
    info = soundfile.info(path)
    assert (info.samplerate, info.frames, info.subtype) == (4000, 2000, "PCM_24")
    assert wavs(tmp_path) == [path.name]
    assert dialog.save.text() == "Replace"
    opened: list[str] = []
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda url: opened.append(url.toLocalFile()) or True)
    dialog.show_folder.click()
    assert opened == [str(tmp_path)]


def test_both_become_two_files_or_two_channels(qtbot: QtBot, made, tmp_path: Path) -> None:
    dialog = made({"source": "files"})
    run(qtbot, dialog, "Saved")
    assert wavs(tmp_path) == ["small_x0.40_a4.0_4000_model.wav", "small_x0.40_a4.0_4000_truth.wav"]
    dialog.sound.source.setCurrentIndex(dialog.sound.source.findData("both"))
    run(qtbot, dialog, "_both.wav")
    assert soundfile.info(tmp_path / "small_x0.40_a4.0_4000_both.wav").channels == 2


def test_stereo_and_the_pick_up_reach_the_file(qtbot: QtBot, made, tmp_path: Path) -> None:
    dialog = made(heard={"stereo": True, "listen_right": 0.7, "pickup": "velocity"})
    assert dialog.sound.source.findData("both") == -1
    assert "both" not in dialog.batch.sources
    run(qtbot, dialog, "Saved")
    with soundfile.SoundFile(tmp_path / "small_x0.40_a4.0_4000_model.wav") as file:
        recipe = json.loads(file.comment)
        assert (file.channels, recipe["listen_right"], recipe["pickup"]) == (2, 0.7, "velocity")


def test_length_by_decay_and_its_limit(qtbot: QtBot, made, tmp_path: Path) -> None:
    dialog = made({"until_decayed": True, "decay_db": 100, "longest_s": 0.3})
    assert dialog.form.decay.isVisible()
    assert not dialog.form.seconds.isVisible()
    run(qtbot, dialog, "Not decayed at the maximum length")
    assert soundfile.info(tmp_path / "small_x0.40_a4.0_4000_model.wav").frames == 1200


def test_what_a_rate_means_is_told(dialog: ExportDialog) -> None:
    rate = dialog.form.rate
    rate.setCurrentIndex(rate.findData(96_000))
    assert dialog.form._rate_note.text() == "adds no bandwidth: the model ends at 2 kHz"
    assert dialog.sound.path.text().endswith("_96000_model.wav")


def test_a_folder_that_is_not_there_is_told(qtbot: QtBot, dialog: ExportDialog, tmp_path: Path) -> None:
    dialog.sound.path.setText(str(tmp_path / "nowhere" / "x.wav"))
    run(qtbot, dialog, "nowhere")
    assert "make the folder first" in dialog.state.text()
    assert dialog.save.isEnabled()
    assert not dialog.show_folder.isVisible()


def test_cancel_leaves_nothing(qtbot: QtBot, dialog: ExportDialog, tmp_path: Path) -> None:
    dialog.form.seconds.setValue(600)
    dialog.save.click()
    assert dialog.close_button.text() == "Cancel"
    dialog.close_button.click()
    qtbot.waitUntil(lambda: "Cancelled" in dialog.state.text())
    assert wavs(tmp_path) == []
    assert list(tmp_path.glob(".*.unfinished")) == []


def test_its_state_is_remembered(made, tmp_path: Path) -> None:
    dialog = made()
    dialog.sound.source.setCurrentIndex(dialog.sound.source.findData("difference"))
    dialog.form.gain.setValue(30)
    dialog.batch.positions.setText("0.1, 0.2")
    assert "difference.wav" in dialog.sound.path.text()
    choices = dialog.export_choices()
    assert (choices.source, choices.folder, choices.seconds) == ("difference", str(tmp_path), 0.5)
    assert (choices.difference_gain_db, choices.batch.positions) == (30, "0.1, 0.2")
    assert made(choices.model_dump(), {"a": "difference", "difference_gain_db": 30.0}).export_choices() == choices


def test_what_is_heard_is_offered_first(qtbot: QtBot, made, tmp_path: Path) -> None:
    assert made({"source": "difference"}).sound.source.currentData() == "model"
    dialog = made({"source": "model"}, {"heard": "b"})
    assert dialog.sound.source.currentData() == "truth"
    run(qtbot, dialog, "Saved")
    assert wavs(tmp_path) == ["small_x0.40_a4.0_4000_truth.wav"]
    dialog = made({}, {"a": "difference", "difference_gain_db": 36.0, "solo": 2})
    assert dialog.sound.source.currentData() == "difference"
    assert (dialog.form.gain.isVisible(), dialog.form.gain.value()) == (True, 36)
    assert "All modes" in dialog.sound.what.text()


def test_another_preset_that_is_heard_is_the_one_that_is_saved(made) -> None:
    dialog = made({"source": "files"}, {"b": "preset:other", "heard": "b"})
    assert dialog.sound.source.currentData() == "model"
    assert Path(dialog.sound.path.text()).name.startswith("other_")
    gone = made({}, {"a": "preset:gone"})
    assert Path(gone.sound.path.text()).name.startswith("small_")


def test_both_stay_chosen_while_one_of_them_is_heard(made) -> None:
    assert made({"source": "files"}, {"heard": "b"}).sound.source.currentData() == "files"
    assert made({"source": "both"}).sound.source.currentData() == "both"
    assert made({"source": "both"}, {"a": "difference"}).sound.source.currentData() == "difference"


def test_a_batch_is_counted_checked_and_written(qtbot: QtBot, made, tmp_path: Path) -> None:
    dialog = made({"batch": {"presets": ("small", "other"), "sources": ("model", "truth"), "positions": "0.3, 0.4"}})
    dialog.tabs.setCurrentIndex(1)
    assert dialog.save.text() == "Export 8 files"
    for field, text, words in (
        (dialog.batch.positions, "0.3, x", "positions: comma-separated numbers"),
        (dialog.batch.amplitudes, "", "amplitudes: give at least one"),
        (dialog.batch.positions, "0.3, 0.3", "positions: one is given twice"),
        (dialog.batch.amplitudes, "99", "amplitude must lie in 0 … 20 mm, not 99 mm"),
    ):
        before = field.text()
        field.setText(text)
        assert words in dialog.state.text()
        assert not dialog.save.isEnabled()
        field.setText(before)
    assert dialog.save.isEnabled()
    run(qtbot, dialog, "8 files written, 0 kept, 0 failed")
    assert len(wavs(tmp_path / "strings")) == 8
    assert (tmp_path / "strings" / "index.csv").is_file()
    run(qtbot, dialog, "0 files written, 8 kept")


def test_a_batch_follows_the_present_pluck_until_a_list_is_given(made) -> None:
    first = made(heard={"amplitude_mm": 2.0})
    batch = first.batch.choices()
    assert (batch.presets, batch.positions, batch.amplitudes) == (("small",), "0.4", "2")
    second = made(first.export_choices().model_dump(), {"amplitude_mm": 7.5, "position": 0.25, "preset": "other"})
    batch = second.batch.choices()
    assert (batch.presets, batch.positions, batch.amplitudes) == (("other",), "0.25", "7.5")
    second.batch.amplitudes.setText("1; 3")
    third = made(second.export_choices().model_dump(), {"amplitude_mm": 5.0, "position": 0.3})
    batch = third.batch.choices()
    assert (batch.presets, batch.positions, batch.amplitudes) == (("small",), "0.3", "1; 3")


def test_a_batch_says_what_all_its_plucks_have_and_shows_what_is_checked(qtbot: QtBot, made) -> None:
    dialog = made({"batch": {"presets": ("small",)}}, {"shape": "raised_cosine", "width": 0.1, "listen": 0.2})
    assert dialog.batch.what.text() == "raised cosine 0.100 wide, heard at 0.20"
    assert dialog.batch.presets.currentItem().checkState() == Qt.CheckState.Checked


def test_a_name_without_its_suffix_gets_it(made) -> None:
    dialog = made({"source": "files"})
    dialog.sound.path.clear()
    QTest.keyClicks(dialog.sound.path, "guitar v1.2")
    assert [path.name for path in dialog.sound.paths().values()] == ["guitar v1.2_model.wav", "guitar v1.2_truth.wav"]
    dialog.sound.source.setCurrentIndex(0)
    assert [path.name for path in dialog.sound.paths().values()] == ["guitar v1.2.wav"]


def test_what_the_patch_adds_is_said_not_to_be_in_the_files(made) -> None:
    guitar = read_patch(PATCHES / "classical_guitar.json")
    dialog = made({}, {"instrument": guitar.model_copy(update={"preset": "small"})})
    words = "The string alone, without the body, room and level that Classical guitar gives it"
    assert words in dialog.sound.what.text()
    assert words in dialog.batch.what.text()
    assert "alone" not in made({}).sound.what.text()


def test_two_files_are_both_named(made) -> None:
    dialog = made({"source": "files"})
    first, second = (path.name for path in dialog.sound.paths().values())
    assert first != second
    assert dialog.sound.names.text() == f"{first}\n{second}"
    dialog.sound.source.setCurrentIndex(0)
    assert dialog.sound.names.isHidden()


def test_a_batch_that_is_cancelled_keeps_what_is_whole(qtbot: QtBot, made, tmp_path: Path) -> None:
    positions = ", ".join(f"{0.2 + 0.01 * i:.2f}" for i in range(60))
    dialog = made({"seconds": 2, "batch": {"positions": positions}})
    dialog.tabs.setCurrentIndex(1)
    dialog.save.click()
    qtbot.waitUntil(lambda: len(wavs(tmp_path / "strings")) > 1 and " left" in dialog.state.text())
    assert ", 4 mm, about " in dialog.state.text()
    dialog.close_button.click()
    qtbot.waitUntil(lambda: "Cancelled; finished files are kept" in dialog.state.text())
    assert 1 < len(wavs(tmp_path / "strings")) < 60
    assert list((tmp_path / "strings").glob(".*.unfinished")) == []


def test_every_control_of_the_dialog_has_a_name_and_a_tip(dialog: ExportDialog) -> None:
    for kind in (QAbstractButton, QComboBox, QDoubleSpinBox, QListWidget, QTabBar):
        for control in dialog.findChildren(kind):
            if control.focusPolicy() != Qt.FocusPolicy.NoFocus and not isinstance(control.parent(), QTabBar):
                assert control.accessibleName() or getattr(control, "text", lambda: "")(), control
                assert control.toolTip(), control.accessibleName()
    for edit in (dialog.sound.path, dialog.batch.positions, dialog.batch.amplitudes, dialog.batch.folder):
        assert edit.accessibleName()
        assert edit.toolTip()
