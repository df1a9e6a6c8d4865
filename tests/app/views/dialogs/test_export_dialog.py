"""The export dialog: what it writes, remembers, and says when it cannot."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import soundfile
from PySide6.QtCore import Qt
from PySide6.QtGui import QDesktopServices
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.export.choices import ExportChoices
from app.export.note import HeardNote
from app.export.recipe import read_recipe
from app.export.sampled.choices import SampledChoices
from app.instruments.instrument import Instrument
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.player.events import NoteOn
from app.presets.library import Library, list_presets
from app.rendering.note_sound import Struck
from app.rendering.subject import path_of
from app.session.choices import Choices
from app.views import theme
from app.views.dialogs.export_dialog import ExportDialog
from app.window.exports import heard_note
from engine.presets import SHIPPED
from tests.app.places import places_in
from tests.app.questions import answered

Make = Callable[..., ExportDialog]
GUITAR = read_instrument(INSTRUMENTS / "classical_guitar.json")


@pytest.fixture
def made(qtbot: QtBot, small_preset: Path, tmp_path: Path) -> Iterator[Make]:
    """Makes a dialog for two presets, `small` and `other`."""
    folder = tmp_path / "presets"
    folder.mkdir()
    for name in ("small", "other"):
        shutil.copy(small_preset, folder / f"{name}.safetensors")
    shutil.copy(SHIPPED / "studio_any_string.safetensors", folder)
    library = Library(list_presets(folder)[0])

    def note(heard: dict[str, object]) -> HeardNote | None:
        choices = Choices(single="small", position=0.4).changed(heard)
        struck = Struck(choices.played, NoteOn(59, 100)) if isinstance(choices.played, Instrument) else None
        return heard_note(choices, library, struck)

    dialogs = []

    def make(more: dict[str, object] | None = None, heard: dict[str, object] | None = None) -> ExportDialog:
        settings = {"rate_hz": 0, "seconds": 0.5, "until_decayed": False, **(more or {})}
        dialog = ExportDialog((ExportChoices.model_validate(settings), SampledChoices()), places_in(tmp_path))
        dialogs.append(dialog)
        qtbot.addWidget(dialog)
        dialog.show_subjects({"note": note(heard or {})})
        dialog.open_at("note")
        return dialog

    make.note = note  # type: ignore[attr-defined]
    yield make
    for dialog in dialogs:
        dialog.accept()


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
    path = tmp_path / "A small string B3 medium.wav"
    for words in (str(path), "dBFS, 0 clipped", "The model was trained on the first "):
        assert words in dialog.state.text()
    info = soundfile.info(path)
    assert (info.samplerate, info.frames, info.subtype) == (4000, 2000, "PCM_24")
    assert wavs(tmp_path) == [path.name]
    assert dialog.save.text() == "Replace"
    opened: list[str] = []
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda url: opened.append(url.toLocalFile()) or True)
    dialog.show_folder.click()
    assert opened == [str(tmp_path)]


def test_flac_is_chosen_in_the_list_or_by_the_ending_and_is_remembered(qtbot: QtBot, made, tmp_path: Path) -> None:
    dialog = made({"format": "wav 32f"})
    edit, form = dialog.note.file.edit, dialog.wav["format"]
    form.setCurrentIndex(form.findData("flac 16"))
    assert Path(edit.text()).name == "A small string B3 medium.flac"
    form.setCurrentIndex(form.findData("wav 32f"))
    edit.selectAll()
    qtbot.keyClicks(edit, str(tmp_path / "mine.flac"))
    assert (form.currentData(), edit.text()) == ("flac 24", str(tmp_path / "mine.flac")), "it has no floating point"
    run(qtbot, dialog, "Saved")
    assert soundfile.info(tmp_path / "mine.flac").subtype == "PCM_24"
    assert read_recipe(tmp_path / "mine.flac").bits == "24"
    assert made(dialog.choices()[0].model_dump()).note.file.edit.text().endswith("medium.flac")
    form.setCurrentIndex(form.findData("wav 16"))
    assert edit.text() == str(tmp_path / "mine.wav"), "a name that was given keeps its stem"


def test_both_become_two_files_which_are_named_before(qtbot: QtBot, made, tmp_path: Path) -> None:
    dialog = made({"source": "files"}, {"stereo": True, "listen_right": 0.7, "pickup": "velocity"})
    names = ["A small string B3 medium model.wav", "A small string B3 medium truth.wav"]
    assert dialog.note.names.text() == "\n".join(names)
    run(qtbot, dialog, "Saved")
    assert wavs(tmp_path) == names
    with soundfile.SoundFile(tmp_path / names[0]) as file:
        recipe = json.loads(file.comment)
        assert (file.channels, recipe["listen_right"], recipe["pickup"]) == (2, 0.7, "velocity")
    dialog.note["source"].setCurrentIndex(0)
    assert dialog.note.names.isHidden()


def test_cancel_leaves_nothing(qtbot: QtBot, dialog: ExportDialog, tmp_path: Path) -> None:
    dialog.note["seconds"].setValue(600)
    dialog.save.click()
    assert dialog.close_button.text() == "Cancel"
    for key in (Qt.Key.Key_Escape, Qt.Key.Key_Return):
        with answered(key):
            QTest.keyClick(dialog, Qt.Key.Key_Escape)
        assert dialog.job is not None and dialog.isVisible()
    dialog.close_button.click()
    qtbot.waitUntil(lambda: "Cancelled" in dialog.state.text())
    assert wavs(tmp_path) == []
    assert list(tmp_path.glob(".*.unfinished")) == []


def test_its_state_is_remembered(made, tmp_path: Path) -> None:
    dialog = made()
    dialog.note["source"].setCurrentIndex(dialog.note["source"].findData("difference"))
    dialog.note["difference_gain_db"].setValue(30)
    assert "difference.wav" in dialog.note.file.edit.text()
    choices, _ = dialog.choices()
    assert (choices.source, choices.seconds) == ("difference", 0.5)
    assert choices.difference_gain_db == 30
    assert made(choices.model_dump(), {"a": "difference", "difference_gain_db": 30.0}).choices()[0] == choices


@pytest.mark.parametrize(
    ("remembered", "heard", "source", "preset"),
    [
        ({"source": "difference"}, {}, "model", "small"),
        ({"source": "model"}, {"heard": "b"}, "truth", "small"),
        ({}, {"a": "difference", "difference_gain_db": 36.0, "solo": 2}, "difference", "small"),
        ({"source": "files"}, {"heard": "b"}, "files", "small"),
        ({"source": "files"}, {"a": "difference"}, "difference", "small"),
        ({"source": "files"}, {"b": "preset:other", "heard": "b"}, "model", "other"),
        ({}, {"a": "preset:gone"}, "model", "small"),
    ],
)
def test_what_is_heard_is_offered_first(
    made, remembered: dict[str, object], heard: dict[str, object], source: str, preset: str
) -> None:
    page = made(remembered, heard).note
    assert page["source"].currentData() == source
    assert path_of(page.job().sound.preset).stem == preset
    if "solo" in heard:
        assert (page["difference_gain_db"].isVisible(), page["difference_gain_db"].value()) == (True, 36)
        assert "All modes" in page.what.text()


def test_a_name_without_its_suffix_gets_it(made) -> None:
    dialog = made({"source": "files"})
    dialog.note.file.edit.clear()
    QTest.keyClicks(dialog.note.file.edit, "guitar v1.2")
    assert [path.name for path in dialog.note.paths().values()] == ["guitar v1.2 model.wav", "guitar v1.2 truth.wav"]
    dialog.note["source"].setCurrentIndex(0)
    assert [path.name for path in dialog.note.paths().values()] == ["guitar v1.2.wav"]


def test_what_the_instrument_adds_is_in_the_file_unless_the_string_alone_is_wanted(
    qtbot: QtBot, made, tmp_path: Path
) -> None:
    """One line says which, with words and not in small print."""
    dialog = made({}, {"played": GUITAR})
    page = dialog.note
    assert page.through.isVisible() and page.through.isChecked()
    words = "Classical guitar with body, room, sympathetic strings and level, as it is heard"
    assert (page.through_words.text(), page.through_words.objectName()) == (words, "")
    run(qtbot, dialog, "Saved")
    path = tmp_path / "Classical guitar B3 hard.wav"
    struck = read_recipe(path).struck
    assert struck is not None and (struck.instrument, struck.key) == (GUITAR.name, 59)
    assert soundfile.info(path).channels == 2
    heard = path.read_bytes()
    page.through.setChecked(False)
    assert page.through_words.text() == "The string alone, without Classical guitar"
    run(qtbot, dialog, "Rendering")
    qtbot.waitUntil(lambda: "Saved" in dialog.state.text())
    assert soundfile.info(path).channels == 1 and path.read_bytes() != heard
    assert read_recipe(path).struck is None
    again = made(dialog.choices()[0].model_dump(), {"played": GUITAR})
    assert again.note.through.isChecked(), "the audible sound is offered first"


def test_it_follows_another_pluck_until_it_begins(qtbot: QtBot, made) -> None:
    dialog, other = made(), made.note({"amplitude_mm": 0.01, "heard": "b"})
    dialog.show_subjects({"note": other})
    assert Path(dialog.note.file.edit.text()).name == "A small string B3 soft truth.wav"
    dialog.note["seconds"].setValue(600)
    dialog.save.click()
    dialog.show_subjects({"note": made.note({})})
    dialog.close_button.click()
    assert "soft" in dialog.note.file.edit.text()
    qtbot.waitUntil(lambda: "Cancelled; no file was written" in dialog.state.text())
    assert "medium" in dialog.note.file.edit.text()


def test_texts_that_wrap_are_seen_whole_at_any_size(qtbot: QtBot, qapp: QApplication, made) -> None:
    sheet, font = qapp.styleSheet(), qapp.font()
    try:
        theme.apply_theme(qapp, "dark", 150)
        dialog = made(None, {"played": read_instrument(INSTRUMENTS / "concert_harp.json")})
        texts = [dialog.note.what, dialog.note.through_words]
        for long in (False, True):  # as it opens, and as a text changes
            if long:
                texts[0].setText("A pluck of a string, heard at two places. " * 3)
            for text in texts:
                qtbot.waitUntil(lambda text=text: text.height() >= text.heightForWidth(text.width()))
        assert dialog.height() <= dialog.screen().availableSize().height()
    finally:
        theme.apply_theme(qapp, "dark")
        qapp.setStyleSheet(sheet)
        qapp.setFont(font)
