"""The export dialog: what its pages write, remember, and say when they cannot."""

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import soundfile
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from app.export.choices import ExportChoices
from app.export.note import HeardNote
from app.export.plugin.formats import FORMATS, install_folder, this_target
from app.export.plugin.identity import identifier
from app.export.recipe import read_recipe
from app.export.sampled.choices import SampledChoices
from app.instruments.library import find_instrument
from app.player.events import NoteOn
from app.presets.library import Library, PresetEntry, list_presets
from app.rendering.note_sound import Struck
from app.rendering.subject import path_of
from app.session.choices import Choices
from app.views.dialogs.export_dialog import ExportDialog
from app.views.dialogs.export_pages import HeardInstrument
from app.window.exports import heard_note
from engine.pluck import Pluck
from engine.presets import SHIPPED
from tests.app.places import places_in
from tests.app.questions import answered

Make = Callable[..., ExportDialog]
GUITAR = find_instrument("Classical guitar").instrument


@pytest.fixture
def library(small_preset: Path, tmp_path: Path) -> Library:
    """Two presets, `small` and `other`, and one of any string."""
    folder = tmp_path / "presets"
    folder.mkdir()
    for name in ("small", "other"):
        shutil.copy(small_preset, folder / f"{name}.safetensors")
    shutil.copy(SHIPPED / "studio_any_string.safetensors", folder)
    return Library(list_presets(folder)[0])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "exports"
    made.mkdir()
    return made


@pytest.fixture
def open_at(qtbot: QtBot, folder: Path) -> Iterator[Callable[..., ExportDialog]]:
    """A function that opens a dialog at a page of these remembered choices, for this subject."""
    dialogs = []

    def opened(page: Any, subject: Any, note: ExportChoices, sampled: SampledChoices) -> ExportDialog:
        dialog = ExportDialog((note, sampled), places_in(folder))
        dialogs.append(dialog)
        qtbot.addWidget(dialog)
        dialog.show_subjects({page: subject})
        dialog.open_at(page)
        return dialog

    yield opened
    for dialog in dialogs:
        dialog.accept()


def run(qtbot: QtBot, dialog: ExportDialog, words: str) -> None:
    dialog.save.click()
    qtbot.waitUntil(lambda: words in dialog.state.text())


def choose(box: Any, data: object) -> None:
    box.setCurrentIndex(box.findData(data))


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def note(library: Library) -> Callable[..., HeardNote | None]:
    """A note of `small`, as it is heard with these choices."""

    def made(**heard: Any) -> HeardNote | None:
        choices = Choices(single="small", pluck=Pluck(0.4)).changed(heard)
        struck = Struck(choices.played, NoteOn(59, 100)) if choices.played else None  # type: ignore[arg-type]
        return heard_note(choices, library, struck)

    return made


@pytest.fixture
def made(open_at: Make, note: Callable[..., HeardNote | None]) -> Make:

    def opened(more: dict[str, object] | None = None, **heard: Any) -> ExportDialog:
        settings = {"rate_hz": 0, "seconds": 0.5, "until_decayed": False, **(more or {})}
        return open_at("note", note(**heard), ExportChoices.model_validate(settings), SampledChoices())

    return opened


def test_it_writes_the_named_file(qtbot, made, folder):
    dialog = made()
    run(qtbot, dialog, "Saved")
    path = folder / "A small string B3 medium.wav"
    for words in (str(path), "dBFS, 0 clipped", "The model was trained on the first "):
        assert words in dialog.state.text()
    info = soundfile.info(path)
    assert (info.samplerate, info.frames, info.subtype) == (4000, 2000, "PCM_24")
    assert names_in(folder) == [path.name] and dialog.save.text() == "Replace"


def test_flac_is_chosen_in_the_list_or_by_the_ending_and_remembered(qtbot, made, folder):
    dialog = made({"format": "wav 32f"})
    edit, form = dialog.note.file.edit, dialog.wav["format"]
    choose(form, "flac 16")
    assert Path(edit.text()).name == "A small string B3 medium.flac"
    choose(form, "wav 32f")
    edit.selectAll()
    qtbot.keyClicks(edit, str(folder / "mine.flac"))
    assert (form.currentData(), edit.text()) == ("flac 24", str(folder / "mine.flac")), "it has no floating point"
    run(qtbot, dialog, "Saved")
    assert soundfile.info(folder / "mine.flac").subtype == "PCM_24"
    assert read_recipe(folder / "mine.flac").settings.bits == "24"
    assert made(dialog.choices()[0].model_dump()).note.file.edit.text().endswith("medium.flac")
    choose(form, "wav 16")
    assert edit.text() == str(folder / "mine.wav"), "a name that was given keeps its stem"


def test_both_become_two_files_which_are_named_before(qtbot, made, folder):
    dialog = made({"source": "files"}, stereo=True, listen_right=0.7, pickup_kind="velocity")
    names = ["A small string B3 medium model.wav", "A small string B3 medium truth.wav"]
    assert dialog.note.names.text() == "\n".join(names)
    run(qtbot, dialog, "Saved")
    assert names_in(folder) == names
    with soundfile.SoundFile(folder / names[0]) as file:
        recipe = json.loads(file.comment)
        assert (file.channels, recipe["ear"]["points"][1], recipe["ear"]["pickup"]) == (2, 0.7, "velocity")
    dialog.note.file.edit.clear()
    QTest.keyClicks(dialog.note.file.edit, "guitar v1.2")  # without its suffix
    assert [path.name for path in dialog.note.paths().values()] == ["guitar v1.2 model.wav", "guitar v1.2 truth.wav"]
    dialog.note["source"].setCurrentIndex(0)
    assert [path.name for path in dialog.note.paths().values()] == ["guitar v1.2.wav"]
    assert dialog.note.names.isHidden()


def test_it_follows_another_pluck_until_it_begins_and_cancel_leaves_nothing(qtbot, made, note, folder):
    dialog = made()
    dialog.show_subjects({"note": note(amplitude_mm=0.01, heard="b")})
    assert Path(dialog.note.file.edit.text()).name == "A small string B3 soft truth.wav"
    dialog.note["seconds"].setValue(600)
    dialog.save.click()
    dialog.show_subjects({"note": note()})
    assert dialog.close_button.text() == "Cancel"
    for key in (Qt.Key.Key_Escape, Qt.Key.Key_Return):
        with answered(key):
            QTest.keyClick(dialog, Qt.Key.Key_Escape)
        assert dialog.job is not None and dialog.isVisible()
    dialog.close_button.click()
    assert "soft" in dialog.note.file.edit.text()
    qtbot.waitUntil(lambda: "Cancelled; no file was written" in dialog.state.text())
    assert "medium" in dialog.note.file.edit.text()
    assert names_in(folder) == []


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
def test_the_sound_that_is_heard_is_offered_first_and_the_choices_are_remembered(
    made, remembered, heard, source, preset
):
    dialog = made(remembered, **heard)
    page = dialog.note
    assert page["source"].currentData() == source
    assert path_of(page.job().sound.preset).stem == preset
    if "solo" in heard:
        assert (page["difference_gain_db"].isVisible(), page["difference_gain_db"].value()) == (True, 36)
        assert "All modes" in page.what.text() and "difference.wav" in page.file.edit.text()
    choices, _ = dialog.choices()
    assert (choices.source, choices.seconds) == (source, 0.5)
    assert made(choices.model_dump(), **heard).choices()[0] == choices


def test_the_instrument_is_in_the_file_unless_the_string_alone_is(qtbot, made, folder):
    dialog = made({}, played=GUITAR)
    page = dialog.note
    assert page.through.isVisible() and page.through.isChecked()
    words = "Classical guitar with body, room, sympathetic strings and level, as it is heard"
    assert (page.through_words.text(), page.through_words.objectName()) == (words, "")
    run(qtbot, dialog, "Saved")
    path = folder / "Classical guitar B3 hard.wav"
    recipe, heard = read_recipe(path), path.read_bytes()
    assert recipe.event is not None and (recipe.instrument, recipe.event.key) == (GUITAR.name, 59)
    assert soundfile.info(path).channels == 2
    page.through.setChecked(False)
    assert page.through_words.text() == "The string alone, without Classical guitar"
    run(qtbot, dialog, "Rendering")
    qtbot.waitUntil(lambda: "Saved" in dialog.state.text())
    assert soundfile.info(path).channels == 1 and path.read_bytes() != heard
    assert read_recipe(path).event is None
    again = made(dialog.choices()[0].model_dump(), played=GUITAR)
    assert again.note.through.isChecked(), "the audible sound is offered first"


@pytest.fixture
def preset(library: Library) -> PresetEntry:
    return library.entries[0]


IMPOSSIBLE = {
    "the lowest is above the highest": lambda form: form.lowest.setValue(63),
    "choose where": lambda form: form.file.edit.setText(""),
    "make the folder first": lambda form: form.file.edit.setText("/nowhere/x.sfz"),
    "a SoundFont's rate": lambda form: (choose(form["form"], "sf2"), form["rate_hz"].setCurrentIndex(2)),
}


@pytest.mark.parametrize("words", IMPOSSIBLE)
def test_a_sampler_is_sized_and_impossible_choices_are_reported(qtbot, open_at, folder, preset, words):
    keys = SampledChoices(keys=(60, 62), layers=2, seconds=0.2)
    dialog = open_at("sampler", HeardInstrument(GUITAR, preset), ExportChoices(), keys)
    form = dialog.sampler
    assert dialog.choices()[1].keys == (60, 62) and form.file.path == folder / "Classical_guitar.sfz"
    form["layers"].setValue(8)
    qtbot.waitUntil(lambda: "24 samples (3 keys, 8 velocity layers), at most" in form.size_text.text())
    IMPOSSIBLE[words](form)
    dialog.save.click()  # before they have settled
    assert words in dialog.state.text() and names_in(folder) == []
    qtbot.waitUntil(lambda: not dialog.save.isEnabled())


@pytest.fixture
def plugin(open_at: Make, preset: PresetEntry, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> ExportDialog:
    def build(images: list[str], form: str, target: str, path: Path, cache: Path, advanced: Any, *, replace: bool):
        assert replace
        advanced("linking", 0.97)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{images} {form} {target} {identifier(images[0])}\0", encoding="utf-8")
        return path

    monkeypatch.setattr("app.export.plugin.formats.find_spec", lambda name: name)
    monkeypatch.setattr("app.export.plugin.build.build_plugin", build)
    monkeypatch.setattr("app.export.plugin.image.image_of", lambda instrument, preset: instrument.name)
    monkeypatch.setattr("app.export.plugin.formats.Path.home", lambda: tmp_path)
    return open_at("plugin", HeardInstrument(GUITAR, preset), ExportChoices(), SampledChoices())


def test_a_plug_in_is_built_where_hosts_look_and_losses_said(qtbot, plugin, folder):
    page = plugin.plugin
    for form in (*FORMATS, "clap"):
        choose(page["form"], form)
        assert page.file.path == install_folder(form, this_target()) / f"Classical guitar.{form}"
    run(qtbot, plugin, f"Built {page.file.path}")
    assert "next scan" in plugin.state.text() and plugin.save.text() == "Replace"
    assert page.file.path.read_text(encoding="utf-8").startswith(f"['Classical guitar'] clap {this_target()}")
    for names, said in (
        (["Classical guitar"], "Replaces the one before."),
        (["Classical guitar", "Concert harp"], "The plug-in that is there holds another instrument, concert-harp"),
        (["Concert harp", "Electric bass"], "The plug-in that is there holds 2 other instruments, as concert-harp"),
    ):
        page.file.path.write_text("".join(f"{identifier(name)}\0" for name in names), encoding="utf-8")
        button, words = page.offer()
        assert button == "Replace" and words.startswith(said)
    page.file.path.write_text("of somebody", encoding="utf-8")
    page.changed.emit()
    qtbot.waitUntil(lambda: "is no plug-in of this program" in plugin.state.text())
    assert not plugin.save.isEnabled()
