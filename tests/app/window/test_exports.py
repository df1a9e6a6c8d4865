"""Playing and notes become files: as they are heard, take after take, kept until they are written, and back."""

import shutil
import threading
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mido
import pytest
import soundfile
from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QInputDialog

from app.export.journal import Journal, left_journals, recordings_folder
from app.export.recipe import read_origin
from app.export.sampled.plan import SampledPlan
from app.player.bodies import own_bodies
from app.player.events import KEYS, InstrumentTurned, NoteOff, NoteOn, TimedEvent, bend_range
from app.player.midi_file import read_midi
from app.playing import playback, recorder
from app.playing.playback import AHEAD_S
from app.shared.version import program_version
from app.views.dialogs.export_dialog import ExportDialog
from app.window.settings import load_settings
from tests.app.questions import answered
from tests.app.window.driver import CONTROL, KEY, LEFT, SHIFT, Window, choose

LOST, BUSY = "Recording not saved", "Export under way"
NAME = "Steel-string acoustic"


def dialog_of(w: Window) -> ExportDialog:
    dialog = w.controller.exports.dialog
    assert dialog is not None
    return dialog


def save(w: Window, path: Path | None = None, words: str = "Saved") -> str:
    """Export what the dialog shows; what it says then."""
    dialog = dialog_of(w)
    if path is not None:
        dialog.performance.file.edit.setText(str(path))
        dialog.performance.file.edit.textEdited.emit(str(path))
    dialog.save.click()
    w.wait(lambda: words in dialog.state.text())
    return dialog.state.text()


def record(w: Window) -> None:
    """A short note, from the click on the button to the end, which opens the dialog."""
    for _ in range(2):
        w.window.instrument.bar.record.click()
        if w.keys.recorder.recording:
            w.play(60)


def takes(w: Window) -> dict[str, dict[str, QAction]]:
    """The takes in the menu beside Record, the latest first, each with what can be done with it."""
    submenus = [action.menu() for action in w.window.instrument.bar.takes.actions() if action.menu() is not None]
    rows: Any = [menu for menu in submenus if menu.actions()[0].text() == "Play"]  # type: ignore[union-attr]
    return {menu.title(): {action.text(): action for action in menu.actions()} for menu in rows}


def latest(w: Window) -> str:
    return next(iter(takes(w)))


def chosen(w: Window, what: str) -> None:
    """Choose what is done with the latest take."""
    takes(w)[latest(w)][what].trigger()


def close(w: Window, *answers: str | Qt.Key) -> list[str]:
    """Close the window and answer its questions; their titles."""
    with answered(*answers) as asked:
        w.window.close()
    return asked


def names(folder: Path, pattern: str = "*") -> set[str]:
    return {path.name for path in folder.glob(pattern) if path.suffix in (".wav", ".mid")}


def test_playing_is_recorded_as_it_is_heard_and_dropped_changes_nothing(guitar, tmp_path):
    for source, words in (("model", "of the model"), ("truth", "the truth"), ("difference", "at +40 dB")):
        guitar.change(a=source, heard="a", difference_gain_db=40.0, solo=3)
        record(guitar)
        assert "The recording has all modes, although mode 3 is soloed." in guitar.said
        file = tmp_path / f"{source}.wav"
        said = save(guitar, file)
        assert f"Saved {file} and {source}.mid" in said and words in said
        sound, rate_hz = soundfile.read(file)
        assert rate_hz == 48_000 and 0 < abs(sound).max() < 1
        events = [each.event for each in read_midi(file.with_suffix(".mid"))]
        assert events[:6] == bend_range(guitar.instrument.bend_semitones, 0)
        assert [type(event) for event in events[6:]] == [NoteOn, NoteOff]
        origin: Any = read_origin(file)
        assert (origin.instrument, origin.preset, origin.source) == (NAME, "studio_any_string", source)
        assert (origin.midi, origin.version) == (f"{source}.mid", program_version())
        assert origin.difference_gain_db == (40.0 if source == "difference" else 0.0)
        assert abs(datetime.now(UTC) - datetime.fromisoformat(origin.recorded)) < timedelta(minutes=10)
    record(guitar)
    choose(dialog_of(guitar).wav["rate_hz"], 44_100)
    dialog_of(guitar).wav["normalise"].setChecked(True)
    save(guitar, tmp_path / "small.flac")
    sound, rate_hz = soundfile.read(tmp_path / "small.flac")
    assert rate_hz == 44_100 and abs(sound).max() == pytest.approx(10 ** (-1 / 20), abs=1e-4)
    before = guitar.choices
    guitar.drop(tmp_path / "small.flac")
    assert f"small.flac: is a recording of {NAME} (the difference" in guitar.window.notices.text
    assert "its notes are in the MIDI file small.mid" in guitar.window.notices.text
    assert guitar.choices == before and not own_bodies().exists(), "it is neither a recipe nor a body"


def test_a_recording_is_kept_until_it_is_saved_and_replaces_no_file_unasked(guitar, tmp_path):
    record(guitar)
    guitar.controller.instruments.choose("concert_harp")  # it was played by the other one
    words = latest(guitar)
    assert words.startswith(f"{NAME}:") and words.endswith("1 note, not saved")
    dialog_of(guitar).reject()
    chosen(guitar, "Save …")
    (tmp_path / "song.mid").write_bytes(b"mine")
    dialog = dialog_of(guitar)
    edit = dialog.performance.file.edit
    edit.setFocus()
    edit.selectAll()
    QTest.keyClicks(edit, str(tmp_path / "song.wav"))
    for _ in range(3):  # before the name has settled, and after
        QTest.keyClick(edit, KEY.Key_Return)
        guitar.wait(lambda: dialog.save.text() == "Replace")
    assert dialog.job is None and dialog.state.text() == "Replaces song.mid."
    assert (tmp_path / "song.mid").read_bytes() == b"mine"
    save(guitar, tmp_path / "take 1.5")
    assert names(tmp_path, "take*") == {"take 1.5.wav", "take 1.5.mid"}
    origin: Any = read_origin(tmp_path / "take 1.5.wav")
    assert origin.instrument == NAME and latest(guitar) == words.replace(NAME, "take 1.5")[: -len(", not saved")]
    guitar.change(preset="gone", instrument=None)
    for name, words in (("export", "There is no preset to export"), ("sampler", "There is no instrument to export")):
        guitar.window.action[name].trigger()
        assert words in guitar.said[-1]


@pytest.mark.parametrize("ended", [False, True])
def test_a_recording_is_asked_about_before_the_window_closes(guitar, tmp_path, ended):
    guitar.window.instrument.bar.record.click()
    guitar.play(60)
    if ended:
        guitar.window.instrument.bar.record.click()
    for answer in (KEY.Key_Escape, KEY.Key_Return, KEY.Key_Space, "Cancel", "Save"):
        assert close(guitar, answer) == [LOST]
        assert guitar.window.isVisible() and guitar.controller.instruments.recordings.unsaved
    save(guitar, tmp_path / "absent" / "take.wav", "absent")  # it cannot be written
    close(guitar, "Save")
    dialog_of(guitar).close_button.click()  # the user thinks better of it
    guitar.controller.instruments.recordings.save_asked.emit()
    save(guitar, tmp_path / "kept.wav")
    assert guitar.window.isVisible()
    record(guitar)
    if ended:
        assert close(guitar, "Discard") == [LOST]
    else:
        close(guitar, "Save")  # where the one before is
        guitar.wait(lambda: not guitar.window.isVisible())
        assert names(tmp_path, "Steel*") == {f"{NAME}.wav", f"{NAME}.mid"}
    assert not guitar.window.isVisible() and left_journals(recordings_folder()) == []


@pytest.mark.parametrize("begun", [True, False])
def test_a_recording_that_no_journal_holds_is_reported_at_once_and_can_be_saved(guitar, tmp_path, begun):
    if not begun:
        recordings_folder().write_text("a file in its place")
    guitar.window.instrument.bar.record.click()
    if begun:
        shutil.rmtree(recordings_folder())
    guitar.play(60)
    guitar.wait(lambda: any("cannot be written to disk while you play" in words for words in guitar.said))
    guitar.window.instrument.bar.record.click()
    save(guitar, tmp_path / "kept.wav")


@pytest.mark.parametrize("finish", [True, False])
def test_an_export_is_asked_about_before_the_window_closes(guitar, tmp_path, finish):
    """Its notes are there at once; its sound is given up, or finished first, as the user says."""
    recordings = guitar.controller.instruments.recordings
    journal = Journal.begun(recordings_folder(), datetime.now(UTC))
    journal.write([TimedEvent(0.0, InstrumentTurned(guitar.instrument))])
    journal.write([TimedEvent(float(second), NoteOn(60, 100)) for second in range(6 if finish else 3_600)])
    journal.close()
    Journal.begun(recordings_folder(), datetime(2026, 1, 1, tzinfo=UTC)).close()  # without a note
    (damaged := journal.path.with_stem("damaged")).write_text("no journal\n")
    guitar.window.instrument.bar.record.click()
    recordings.offer_left()
    guitar.wait(lambda: guitar.said and "next start" in guitar.said[-1])  # not over another recording
    guitar.window.instrument.bar.record.click()
    with answered(KEY.Key_Return) as asked:
        recordings.offer_left()
        guitar.wait(lambda: recordings.offered is not None)
    assert asked == ["Recover what was played?"]
    assert any(words.endswith("it cannot be recovered, and stays where it is.") for words in guitar.said)
    assert {damaged, journal.path} == set(recordings_folder().glob(f"*{journal.path.suffix}"))
    save(guitar, tmp_path / "take.wav", "Rendering")
    if finish:
        assert close(guitar, "Finish first") == [BUSY]
        guitar.wait(lambda: not guitar.window.isVisible())
    else:
        guitar.wait((tmp_path / "take.mid").is_file)
        for answer in (KEY.Key_Escape, KEY.Key_Return, "Stay", "Finish first"):
            assert close(guitar, answer) == [BUSY]
            assert guitar.window.isVisible() and guitar.controller.exports.busy
        assert close(guitar, "Cancel export", "Discard") == [BUSY, LOST]
        assert not guitar.window.isVisible()
    assert names(tmp_path) == {"take.mid", *(["take.wav"] if finish else [])}


def test_takes_are_written_beside_the_first(guitar, tmp_path, monkeypatch):
    folder = tmp_path / "takes"
    folder.mkdir()
    (folder / f"{NAME} 2.mid").write_bytes(b"mine")
    record(guitar)
    save(guitar, folder / f"{NAME}.wav")
    dialog_of(guitar).reject()
    record(guitar)
    guitar.wait(lambda: "saved" not in latest(guitar))
    assert guitar.said[-1].startswith(f"Saved {folder / f'{NAME} 3.wav'} and ")
    assert guitar.controller.exports.dialog is None
    assert [title.split(":")[0] for title in takes(guitar)] == [f"{NAME} 3", NAME]
    typed = iter([("a/b", True), (f"{NAME} 2", True), ("Best", True)])
    asked: list[str] = []
    monkeypatch.setattr(QInputDialog, "getText", lambda _, title, words, text="": asked.append(words) or next(typed))
    chosen(guitar, "Rename …")
    assert "must not" in asked[1] and f"{NAME} 2.mid is there already" in asked[2]
    assert {"Best.wav", "Best.mid"} <= names(folder) and latest(guitar).startswith("Best:")
    (folder / "Best.mid").write_bytes(b"edited in another program")
    before = names(folder)
    for answer, deleted in (("Keep", set[str]()), ("Delete", {"Best.wav"})):
        with answered(answer):
            chosen(guitar, "Delete …")
        assert names(folder) == before - deleted
    assert len(takes(guitar)) == 1 and (folder / f"{NAME} 2.mid").read_bytes() == b"mine"
    folder.rename(tmp_path / "moved")
    record(guitar)
    guitar.wait(lambda: "menu beside Record" in guitar.said[-1])
    assert "make the folder first" in guitar.said[-1] and latest(guitar).endswith("not saved")
    record(guitar)  # asks for another place
    save(guitar, tmp_path / "elsewhere.wav")


def test_a_take_is_played_again_with_the_knobs_that_were_turned(guitar, tmp_path):
    instrument = guitar.instrument
    guitar.window.instrument.bar.record.click()
    guitar.play(64, hold=True)
    guitar.controller.instruments.change("level_db", -9.0)
    guitar.wait(lambda: guitar.struck[-1].seconds > 0.4)
    guitar.window.instrument.released.emit(64, None)
    guitar.window.instrument.bar.record.click()
    save(guitar, tmp_path / "first.wav")
    dialog_of(guitar).reject()
    guitar.choose("concert_harp")
    guitar.qtbot.wait(600)  # or both choices were one step of undo
    guitar.struck.clear()
    chosen(guitar, "Play")
    guitar.wait(lambda: [note.event.key for note in guitar.struck] == [64])
    assert guitar.instrument == instrument and guitar.struck[0].instrument == instrument
    guitar.wait(lambda: guitar.keys.player is not None and guitar.keys.player.instrument.level_db == -9.0)
    guitar.wait(lambda: not guitar.controller.instruments.playing)
    guitar.wait(lambda: guitar.keys.player is not None and guitar.keys.player.instrument == instrument)
    guitar.session.undo()
    assert guitar.instrument.name == "Concert harp"


def test_a_counted_take_begins_at_its_beat(guitar, tmp_path, monkeypatch):
    now_s, bar = 1000.0, guitar.window.instrument.bar
    clock = SimpleNamespace(monotonic=lambda: now_s)
    monkeypatch.setattr(recorder, "time", clock)
    monkeypatch.setattr(playback, "time", clock)
    bar.takes.choose({"count_in_bars": 1})
    bar.takes.choose({"tempo_bpm": 96})
    guitar.key(KEY.Key_R, CONTROL)
    beat_s = now_s + AHEAD_S + guitar.notes.sound.buffer_s + 4 * 60 / 96
    for after_s, key in ((-1.0, 50), (-0.05, 64), (0.5, 60)):  # too early, just before the beat, after it
        now_s = beat_s + after_s
        guitar.controller.inputs.play(NoteOn(key, 90, KEYS))
    now_s = beat_s + 1.1
    guitar.key(KEY.Key_R, CONTROL)
    save(guitar, tmp_path / "counted.wav")
    (track,) = mido.MidiFile(tmp_path / "counted.mid").tracks
    assert [each.tempo for each in track if each.type == "set_tempo"] == [625_000]
    struck = [each for each in read_midi(tmp_path / "counted.mid") if isinstance(each.event, NoteOn)]
    assert [each.event.key for each in struck] == [64, 60]
    assert [each.time_s for each in struck] == pytest.approx([0.0, 0.5], abs=1e-3)


def open_sampler(w: Window) -> ExportDialog:
    w.window.activateWindow()
    w.key(KEY.Key_E, CONTROL | SHIFT)
    return dialog_of(w)


def test_a_sampler_is_written_while_keys_play(guitar, tmp_path, monkeypatch):
    dialog, begun = open_sampler(guitar), threading.Event()
    assert not dialog.isModal() and open_sampler(guitar) is dialog
    guitar.choose("concert_harp")
    assert dialog.sampler.what.text().startswith("Concert harp")
    dialog.save.click()
    guitar.wait(lambda: "Saved" in dialog.state.text() and "Concert_harp.sfz" in dialog.state.text())
    stems = [path.stem for path in sorted((tmp_path / "Concert_harp_samples").glob("*.flac"))]
    assert stems == [zone.stem for zone in SampledPlan(guitar.instrument, (60, 61), layers=1).zones]
    dialog.sampler["layers"].setValue(7)
    assert guitar.controller.settings().sampled.layers == 7, "should the process be killed now"
    dialog.close()

    def export(plan: object, out: object, render: object, progress: Callable[[float], None]) -> None:
        begun.set()
        while True:
            progress(0.0)
            time.sleep(0.01)

    monkeypatch.setattr("app.export.sampled.job.export_sampled", export)
    dialog = open_sampler(guitar)
    dialog.sampler.file.edit.setText(str(tmp_path / "Other.sfz"))
    guitar.wait(dialog.isActiveWindow)
    guitar.qtbot.mouseClick(dialog.save, LEFT)
    guitar.wait(begun.is_set)
    guitar.wait(guitar.window.isActiveWindow)  # without a click
    focused = QApplication.activeWindow().focusWidget() or guitar.window
    guitar.qtbot.keyPress(focused, KEY.Key_A)
    guitar.wait(guitar.keys.sounding)
    guitar.qtbot.keyRelease(focused, KEY.Key_A)
    assert close(guitar, KEY.Key_Return) == [BUSY] and guitar.window.isVisible()
    guitar.window.activateWindow()
    guitar.wait(guitar.window.isActiveWindow)
    with answered("Cancel export"):
        guitar.key(KEY.Key_Q, CONTROL)
    assert not guitar.window.isVisible()
    remembered = load_settings(tmp_path / "settings.json")[0]
    assert (remembered.sampled.layers, remembered.sampled.keys) == (7, (60, 61))
