"""Files out of the window and back: dragged, copied, saved as, opened again, shown in their folder."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from PySide6.QtCore import QPoint, QProcess, Qt
from PySide6.QtGui import QDesktopServices, QDrag, QGuiApplication
from PySide6.QtWidgets import QMenu, QToolTip

from app.export.choices import ExportChoices
from app.export.recipe import read_origin, read_recipe
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import find_instrument, own_instruments, read_instrument
from app.player.events import KEYS, NoteOff, NoteOn, TimedEvent
from app.player.midi_file import midi_bytes
from app.views.controls.drag_handle import DragHandle
from app.views.file_manager import reveal
from app.views.file_places import MOST_RECENT, FileChoices, FilePlaces
from app.window.settings import load_settings
from tests.app.places import choose_files, files_in
from tests.app.window.conftest import Open
from tests.app.window.driver import CONTROL, KEY, LEFT, SHIFT, Window, press

GUITAR = find_instrument("Classical guitar").instrument
AWAY = QPoint(60, 60)


@pytest.fixture
def made(opened: Open, tmp_path: Path) -> Window:
    """A window that exports short sounds of a guitar to a folder."""
    export = ExportChoices(until_decayed=False, seconds=0.3, normalise=False)
    files = files_in(tmp_path)
    window = opened("studio_any_string", settings={"export": export, "files": files}, instrument=GUITAR)
    window.wait_for_keys()
    return window


@pytest.fixture
def dropped(monkeypatch: pytest.MonkeyPatch) -> list[list[Path]]:
    """The files of each drag, which would be copied to where they are dropped."""
    drags: list[list[Path]] = []

    def drop(drag: QDrag, actions: Qt.DropAction) -> Qt.DropAction:
        data = drag.mimeData()
        assert data.formats() == ["text/uri-list"] and actions == Qt.DropAction.CopyAction
        drags.append([Path(url.toLocalFile()) for url in data.urls()])
        return actions

    monkeypatch.setattr(QDrag, "exec", drop)
    return drags


def exported(w: Window, name: str) -> Path:
    """The file of the export that the dialog offers first."""
    w.controller.exports.open("note" if "recording" not in name else "performance")
    dialog = w.controller.exports.dialog
    assert dialog is not None
    dialog.save.click()
    w.wait(lambda: "Saved" in dialog.state.text())
    dialog.accept()
    return w.window.places.folder("note") / name


def pull(w: Window, handle: DragHandle) -> None:
    """Press the handle and move the mouse away, still pressed."""
    w.qtbot.mousePress(handle, LEFT, pos=QPoint(5, 5))
    w.qtbot.mouseMove(handle, AWAY)


def same_sound(file: Path, other: Path) -> bool:
    assert file.name == other.name and file != other
    return bool(np.array_equal(soundfile.read(file)[0], soundfile.read(other)[0]))


def test_a_note_its_difference_and_a_recording_are_dragged_as_they_would_be_exported(
    made: Window, dropped: list[list[Path]]
) -> None:
    made.play(52)
    made.wait_for_string()
    handle = made.find(DragHandle)
    pull(made, handle)
    made.wait(lambda: len(dropped) == 1)
    made.qtbot.mouseRelease(handle, LEFT, pos=AWAY)
    (note,) = dropped[0]
    assert note.name == "Classical guitar E3 hard.wav" and read_recipe(note).struck is not None
    file = exported(made, note.name)
    assert note.read_bytes() == file.read_bytes() and same_sound(note, file)
    pull(made, handle)
    assert dropped[1:] == [[note]], "what is rendered already is dragged at once"
    made.qtbot.mouseRelease(handle, LEFT, pos=AWAY)
    handle.show_subject("difference")
    pull(made, handle)
    made.wait(lambda: len(dropped) == 3)
    made.qtbot.mouseRelease(handle, LEFT, pos=AWAY)
    made.change(a="difference", heard="a", difference_gain_db=20.0)
    (difference,) = dropped[2]
    assert difference.read_bytes() == exported(made, difference.name).read_bytes()
    assert difference.name == "Classical guitar E3 hard difference.wav"
    handle.show_subject("note")
    pull(made, handle)
    made.qtbot.mouseRelease(handle, LEFT, pos=AWAY)
    made.wait(lambda: QToolTip.text() == "Rendered: drag it now")
    assert len(dropped) == 3 and handle.text() == "⋮⋮ Drag note"
    made.window.instrument.bar.record.click()
    made.play(60)
    made.window.instrument.bar.record.click()
    dialog = made.controller.exports.dialog
    assert dialog is not None
    dialog.accept()
    assert handle.subject == "recording" and "Drag recording" in handle.text()
    pull(made, handle)
    made.wait(lambda: len(dropped) == 4)
    (recording,) = dropped[3]
    origin: Any = read_origin(recording)
    assert (recording.name, origin.instrument) == ("Classical guitar.wav", "Classical guitar")
    made.qtbot.mouseRelease(handle, LEFT, pos=AWAY)
    made.controller.instruments.recordings.forget_all()
    assert handle.subject == "note"
    made.close()
    assert not any(file.exists() for files in dropped for file in files), "they are removed with the process"


def test_a_click_on_the_handle_or_a_key_copies_files_and_drags_nothing(
    made: Window, dropped: list[list[Path]]
) -> None:
    made.play(52)
    made.wait_for_string()
    clipboard = QGuiApplication.clipboard()
    clipboard.clear()
    made.key(KEY.Key_C, CONTROL | SHIFT)
    made.wait(lambda: clipboard.mimeData() and clipboard.mimeData().urls())
    (url,) = clipboard.mimeData().urls()
    assert read_recipe(Path(url.toLocalFile())).source == "model"
    assert made.said[-1] == "Copied Classical guitar E3 hard.wav: paste in a file manager."
    handle = made.find(DragHandle)
    made.qtbot.mouseClick(handle, LEFT)
    menu = next(each for each in handle.findChildren(QMenu) if each.isVisible())
    difference, recording, copy = menu.actions()[1], menu.actions()[2], menu.actions()[-1]
    recording.trigger()
    pull(made, handle)
    made.qtbot.mouseRelease(handle, LEFT, pos=AWAY)
    assert "record" in made.said[-1].lower() and not dropped
    difference.trigger()
    copy.trigger()
    menu.close()
    made.wait(lambda: "difference.wav" in made.said[-1])
    assert not dropped and "difference" in handle.accessibleName()
    pull(made, handle)
    made.qtbot.mouseRelease(handle, LEFT, pos=AWAY)
    assert len(dropped) == 1 and not menu.isVisible(), "a drag is no click"


def test_files_that_are_handed_out_are_bounded_and_a_full_disk_is_said(
    made: Window, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.window.drag_out.LARGEST_BYTES", 100_000)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))

    def copied(key: int) -> str:
        made.play(key)
        made.wait_for_string()
        before = made.said
        made.key(KEY.Key_C, CONTROL | SHIFT)
        made.wait(lambda: made.said != before)
        return made.said[-1]

    names = [copied(key).split(": paste")[0].removeprefix("Copied ") for key in (52, 55, 59, 60, 62)]
    handed = {file.name for file in tmp_path.glob(".learned-strings-files*/*")}
    assert {*names[-2:]} <= handed < {*names}, "the oldest make room"
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "gone"))
    assert "gone: cannot be written" in copied(64)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    made.close()
    assert not any(tmp_path.glob(".learned-strings-files*"))


def test_an_instrument_is_saved_anywhere_and_shown_in_its_folder(
    made: Window, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[str] = []
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda url: shown.append(url.toLocalFile()) or True)
    made.window.action["reveal"].trigger()
    assert made.said[-1] == "Nothing was saved since the start."
    far, own = tmp_path / "far", own_instruments()
    far.mkdir()

    def save_as(*files: Path) -> str:
        choose_files(monkeypatch, *files)
        made.key(KEY.Key_S, CONTROL | SHIFT)
        return made.said[-1]

    said = made.said
    assert save_as() == said[-1] and made.said == said, "cancelled"
    file = far / "My v1.2.json"
    assert save_as(far / "My v1.2") == f"My v1.2 was saved as {file}."
    assert read_instrument(file) == GUITAR.model_copy(update={"name": "My v1.2"}) and made.instrument == GUITAR
    press(made.window.notices, "Show in folder")
    made.window.action["reveal"].trigger()
    assert shown == [str(far), str(far)]
    assert "must not" in save_as(far / "a:b.json") and "factory" in save_as(own / "classical_guitar.json")
    assert "cannot be written" in save_as(file / "under a file.json")
    assert sorted(far.iterdir()) == [file]
    save_as(own / "Mine.json")
    assert made.instrument.name == "Mine" and made.controller.instruments.chosen == "Mine"
    made.controller.instruments.change("knobs.decay", 3.0)
    made.key(KEY.Key_S, CONTROL)
    made.window.action["reveal"].trigger()
    assert shown[2:] == [str(own)] and read_instrument(own / "Mine.json").knobs.decay == 3.0
    file.unlink()
    reveal(file, said.append)
    assert said[-1] == f"{file} is not there any more."


def test_the_file_manager_is_asked_without_a_shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "a & b; c.wav"
    file.touch()
    started: list[tuple[str, list[str]]] = []
    monkeypatch.setattr(QProcess, "startDetached", lambda *given: started.append(given) or (True, 1))
    for platform in ("win32", "darwin"):
        monkeypatch.setattr(sys, "platform", platform)
        reveal(file, print)
    assert [arguments for _, arguments in started] == [["/select,", str(file)], ["-R", str(file)]]


def test_recent_files_are_listed_opened_again_and_forgotten_when_they_are_gone(
    made: Window, tmp_path: Path, fill: Callable[[], list[str]]
) -> None:
    song, scale = tmp_path / "a & b.mid", tmp_path / "third.scl"
    song.write_bytes(midi_bytes([TimedEvent(0.0, NoteOn(60, 90, KEYS)), TimedEvent(0.1, NoteOff(60, KEYS))], GUITAR))
    scale.write_text("! third.scl\nThirds\n 3\n!\n5/4\n3/2\n2/1\n")
    instrument = INSTRUMENTS / "concert_harp.json"
    assert fill() == []
    for file in (song, instrument, scale, song):
        made.drop(file)
    assert [line.split("\t")[0] for line in fill()] == ["&1  a && b.mid", "&2  third.scl", "&3  concert_harp.json"]
    recent = made.window.action["recent"].menu()
    assert recent is not None
    recent.actions()[2].trigger()
    assert made.instrument.name == "Concert harp" and "concert_harp" in fill()[0]
    song.unlink()
    recent.actions()[1].trigger()
    assert "a & b.mid" in made.said[-1] and len(fill()) == 2, "it is gone, and was removed"
    made.close()
    assert load_settings(tmp_path / "settings.json")[0].files.recent == (instrument, scale)


@pytest.fixture
def fill(made: Window) -> Callable[[], list[str]]:
    """Opens the menu, and gives the lines of the recent files."""

    def filled() -> list[str]:
        made.window.menu.aboutToShow.emit()
        action = made.window.action["recent"]
        lines = [each.text() for each in action.menu().actions()]  # type: ignore[attr-defined]
        assert action.isEnabled() == bool(lines)
        return lines

    return filled


def test_folders_are_remembered_by_kind_and_only_full_paths_are_read(
    made: Window, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    places, there, gone = FilePlaces(), tmp_path / "there", tmp_path / "gone"
    there.mkdir()
    (there / "a.wav").touch()
    shown = choose_files(monkeypatch, there / "a.wav")
    assert places.ask_to_save(made.window, "note", "Save", "", there / "b.wav") == there / "a.wav"
    assert shown == [str(there / "b.wav")]
    assert places.folder("note") == there != places.folder("recording")
    places.remember("recording", gone)
    assert places.folder("recording", tmp_path) == tmp_path and places.folder("recording") != gone
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
