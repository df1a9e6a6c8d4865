"""Files out of the window and back: dragged, copied, saved as, opened again, shown in their folder."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QDesktopServices, QDrag, QGuiApplication

from app.export.recipe import read_origin, read_recipe
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import own_instruments, read_instrument
from app.player.events import NoteOff, NoteOn, TimedEvent
from app.player.midi_file import midi_bytes
from app.player.offline import render_note
from app.views.controls.drag_handle import DragHandle
from app.views.file_manager import reveal
from app.views.file_places import MOST_RECENT, FileChoices, FilePlaces
from app.window.settings import load_settings
from engine.presets import load_preset
from engine.presets.finding import SHIPPED
from tests.app.places import choose_files
from tests.app.window.driver import CONTROL, KEY, LEFT, SHIFT, press
from tests.app.window.test_exports import NAME, dialog_of, record, save

AWAY = QPoint(60, 60)


@pytest.fixture
def dropped(monkeypatch) -> list[Path]:
    """The files that are dragged, one a drag, which would be copied to where they are dropped."""
    drags: list[Path] = []

    def drop(drag: QDrag, actions: Qt.DropAction) -> Qt.DropAction:
        data = drag.mimeData()
        assert data.formats() == ["text/uri-list"] and actions == Qt.DropAction.CopyAction
        drags.extend(Path(url.toLocalFile()) for url in data.urls())
        return actions

    monkeypatch.setattr(QDrag, "exec", drop)
    return drags


def test_what_is_dragged_is_what_would_be_exported(guitar, tmp_path, dropped):
    def exported(name: str) -> bytes:
        guitar.controller.exports.open("note")
        save(guitar)
        dialog_of(guitar).accept()
        return (tmp_path / name).read_bytes()

    def dragged(count: int) -> Path:
        """Drag what must be rendered first, with the button held until that has been."""
        guitar.qtbot.mousePress(handle, LEFT, pos=QPoint(5, 5))
        guitar.qtbot.mouseMove(handle, AWAY)
        guitar.wait(lambda: len(dropped) == count)
        guitar.qtbot.mouseRelease(handle, LEFT, pos=AWAY)
        return dropped[-1]

    start = guitar.instrument
    guitar.change(instrument=start.with_value("knobs.decay", 1.5))
    guitar.wait_for_keys()
    guitar.play(52)
    guitar.wait_for_string()
    handle = guitar.find(DragHandle)
    note, preset = dragged(1), load_preset(SHIPPED / "studio_any_string.safetensors")
    assert note.name == f"{NAME} E3 hard.wav" and note.read_bytes() == exported(note.name)
    heard, written = render_note(guitar.instrument, preset, 52, 100, 9.0, 0.3, 48_000), soundfile.read(note)[0]
    np.testing.assert_allclose(written[:-960], heard[:-960], atol=2.0**-22)  # the end is faded
    guitar.drag(handle, QPoint(5, 5), AWAY)
    assert dropped == [note, note], "what is rendered already is dragged at once"
    record(guitar)
    dialog_of(guitar).accept()
    assert handle.subject == "recording" and "Drag recording" in handle.text()
    recording = dragged(3)
    origin: Any = read_origin(recording)
    assert (recording.name, origin.instrument) == (f"{NAME}.wav", NAME)
    guitar.controller.instruments.recordings.forget_all()
    guitar.change(preset="first")
    guitar.drop(note)
    assert guitar.choices.played == start
    assert f"instrument {NAME} is not the one" in guitar.window.notices.text
    guitar.close()
    assert not any(file.exists() for file in dropped), "they are removed with the process"


def test_copied_files_are_bounded(guitar, tmp_path, dropped, monkeypatch):
    monkeypatch.setattr("app.window.drag_out.LARGEST_BYTES", 200_000)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    clipboard = QGuiApplication.clipboard()
    clipboard.clear()

    def copied(key: int) -> str:
        guitar.play(key)
        guitar.wait_for_string()
        before = guitar.said
        guitar.key(KEY.Key_C, CONTROL | SHIFT)
        guitar.wait(lambda: guitar.said != before)
        return guitar.said[-1]

    said = [copied(key) for key in (52, 55, 59, 60, 62)]
    assert said[0] == f"Copied {NAME} E3 hard.wav: paste in a file manager."
    (url,) = clipboard.mimeData().urls()
    assert read_recipe(Path(url.toLocalFile())).source == "model"
    names = [each.split(": paste")[0].removeprefix("Copied ") for each in said]
    handed = {file.name for file in tmp_path.glob(".learned-strings-files*/*")}
    assert {*names[-2:]} <= handed < {*names}, "the oldest make room"
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "gone"))
    assert "gone: cannot be written" in copied(64)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    guitar.close()
    assert not any(tmp_path.glob(".learned-strings-files*"))


def test_an_instrument_is_saved_anywhere(guitar, tmp_path, monkeypatch):
    shown: list[str] = []
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda url: shown.append(url.toLocalFile()) or True)
    guitar.window.action["reveal"].trigger()
    assert guitar.said[-1] == "Nothing was saved since the start."
    far, own, start = tmp_path / "far", own_instruments(), guitar.instrument
    far.mkdir()

    def save_as(*files: Path) -> str:
        choose_files(monkeypatch, *files)
        guitar.key(KEY.Key_S, CONTROL | SHIFT)
        return guitar.said[-1]

    said = guitar.said
    assert save_as() == said[-1] and guitar.said == said, "cancelled"
    file = far / "My v1.2.json"
    assert save_as(far / "My v1.2") == f"My v1.2 was saved as {file}."
    assert read_instrument(file) == start.model_copy(update={"name": "My v1.2"}) and guitar.instrument == start
    press(guitar.window.notices, "Show in folder")
    guitar.window.action["reveal"].trigger()
    assert shown == [str(far), str(far)]
    assert "must not" in save_as(far / "a:b.json") and "factory" in save_as(own / "classical_guitar.json")
    assert "cannot be written" in save_as(file / "under a file.json")
    assert sorted(far.iterdir()) == [file]
    save_as(own / "Mine.json")
    assert guitar.instrument.name == "Mine" and guitar.controller.instruments.chosen == "Mine"
    guitar.controller.instruments.change("knobs.decay", 3.0)
    guitar.key(KEY.Key_S, CONTROL)
    guitar.window.action["reveal"].trigger()
    assert shown[2:] == [str(own)] and read_instrument(own / "Mine.json").knobs.decay == 3.0
    file.unlink()
    reveal(file, said.append)
    assert said[-1] == f"{file} is not there any more."


def test_recent_files_are_listed_until_they_are_gone(guitar, tmp_path):
    song, scale = tmp_path / "a & b.mid", tmp_path / "third.scl"
    song.write_bytes(midi_bytes([TimedEvent(0.0, NoteOn(60, 90)), TimedEvent(0.1, NoteOff(60))], guitar.instrument))
    scale.write_text("! third.scl\nThirds\n 3\n!\n5/4\n3/2\n2/1\n")
    instrument = INSTRUMENTS / "concert_harp.json"

    def listed() -> list[str]:
        guitar.window.menu.aboutToShow.emit()
        lines = [each.text().split("\t")[0] for each in recent.menu().actions()]
        assert recent.isEnabled() == bool(lines)
        return lines

    recent: Any = guitar.window.action["recent"]
    assert listed() == []
    for file in (song, instrument, scale, song):
        guitar.drop(file)
    assert listed() == ["&1  a && b.mid", "&2  third.scl", "&3  concert_harp.json"]
    recent.menu().actions()[2].trigger()
    assert guitar.instrument.name == "Concert harp" and "concert_harp" in listed()[0]
    song.unlink()
    recent.menu().actions()[1].trigger()
    assert "a & b.mid" in guitar.said[-1] and len(listed()) == 2, "it is gone, and was removed"
    guitar.close()
    assert load_settings(tmp_path / "settings.json")[0].files.recent == (instrument, scale)


def test_recent_files_and_folders_are_bounded_and_can_be_written(tmp_path):
    places = FilePlaces()
    for number in range(MOST_RECENT + 5):
        (tmp_path / f"{number}.mid").touch()
        places.opened(tmp_path / f"{number}.mid")
    places.opened(tmp_path / "no text \udcff.mid")
    places.remember("note", tmp_path / "no text \udcff")
    assert [file.stem for file in places.choices.recent] == [str(number) for number in range(MOST_RECENT + 4, 4, -1)]
    assert FileChoices.model_validate_json(places.choices.model_dump_json()) == places.choices
    for wrong in ({"recent": ["../song.mid"]}, {"folders": {"note": "music"}}, {"recent": ["/a"] * 11}):
        with pytest.raises(ValueError):
            FileChoices.model_validate(wrong)
