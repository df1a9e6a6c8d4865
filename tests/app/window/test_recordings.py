"""What is played is recorded as it is heard; it is kept until it is written or discarded."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
import soundfile
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from app.export.journal import Journal, left_journals, recordings_folder
from app.export.played import Played
from app.export.recipe import InstrumentSound, read_origin
from app.instrument.bodies import own_bodies
from app.instrument.events import NoteOff, NoteOn, PatchTurned, TimedEvent, bend_range
from app.instrument.midi_file import read_midi
from app.shared.version import program_version
from app.views.dialogs.export_dialog import ExportDialog
from app.window.controller import Controller
from tests.app.questions import answered


class Reported:
    """The notices to the user."""

    def __init__(self, played: Controller) -> None:
        self.errors: list[str] = []
        self.good: list[str] = []
        played.patches.reported.connect(self.errors.append)
        played.patches.informed.connect(self.good.append)


@pytest.fixture
def reported(played: Controller) -> Reported:
    return Reported(played)


def close(played: Controller, *answers: str | Qt.Key) -> list[str]:
    """Closes the window and answers its questions; their titles."""
    with answered(*answers) as asked:
        played.window.close()
    return asked


def dialog_of(played: Controller) -> ExportDialog:
    """The export dialog, which the end of a recording opens."""
    dialog = played.exports.dialog
    assert dialog is not None and dialog.kind == "performance"
    return dialog


def save(qtbot: QtBot, played: Controller, path: Path, words: str = "Saved") -> str:
    """Exports the latest recording; what the dialog says then."""
    dialog = dialog_of(played)
    dialog.performance.file.edit.setText(str(path))
    dialog.performance.file.edit.textEdited.emit(str(path))
    dialog.save.click()
    qtbot.waitUntil(lambda: words in dialog.state.text())
    return dialog.state.text()


def play(played: Controller, key: int = 60) -> None:
    played.window.instrument.pressed.emit(key, 100, None)
    played.window.instrument.released.emit(key, None)


def record(played: Controller) -> None:
    """A short note, from the click on the button to the end."""
    played.patches.recordings.record()
    play(played)
    played.patches.recordings.record()


def test_what_is_played_is_recorded_as_wav_and_midi(
    qtbot: QtBot, played: Controller, reported: Reported, tmp_path: Path
) -> None:
    recordings = played.patches.recordings
    recordings.record()
    recordings.record()
    assert "Nothing was played" in reported.good[0]
    out = tmp_path / "take.wav"
    record(played)
    assert "1 note in" in dialog_of(played).performance.what.text()
    words = save(qtbot, played, out)
    assert f"Saved {out} and take.mid" in words and "of the model" in words
    assert not reported.errors
    sound, rate_hz = soundfile.read(out)
    assert rate_hz == 48_000
    assert 0.001 < abs(sound).max() < 1
    events = [each.event for each in read_midi(out.with_suffix(".mid"))]
    patch = played.session.choices.patch
    assert patch is not None and events[:6] == bend_range(patch.bend_semitones, 0)
    assert [type(event) for event in events[6:]] == [NoteOn, NoteOff]
    assert recordings.latest is None


def test_a_recording_replaces_no_file_that_nobody_asked_about(
    qtbot: QtBot, played: Controller, reported: Reported, tmp_path: Path
) -> None:
    (tmp_path / "song.mid").write_bytes(b"mine")
    record(played)
    dialog = dialog_of(played)
    dialog.performance.file.edit.setText(str(tmp_path / "song.wav"))
    dialog.performance.file.edit.textEdited.emit("")
    qtbot.waitUntil(lambda: dialog.save.text() == "Replace")
    assert dialog.state.text() == "Replaces song.mid."
    assert (tmp_path / "song.mid").read_bytes() == b"mine"
    save(qtbot, played, tmp_path / "take 1.5")
    assert {path.name for path in tmp_path.glob("take 1.5*")} == {"take 1.5.wav", "take 1.5.mid"}


def test_a_recording_is_kept_until_it_is_saved_or_discarded(
    qtbot: QtBot, played: Controller, reported: Reported, tmp_path: Path
) -> None:
    bar, recorder = played.window.instrument.bar, played.performance.notes.keys.recorder
    record(played)
    assert "Unsaved" in bar.record.text()
    ask, discard = bar._unsaved_menu.actions()
    played.patches.choose("concert_harp")  # it was played by the other one
    dialog_of(played).reject()
    ask.trigger()
    dialog_of(played).reject()
    played.patches.recordings.record()  # opens it again, and records nothing over it
    assert not recorder.recording
    save(qtbot, played, tmp_path / "kept.wav")
    assert "Unsaved" not in bar.record.text()
    origin = read_origin(tmp_path / "kept.wav")
    assert isinstance(origin, InstrumentSound) and origin.instrument == "Steel-string acoustic"
    record(played)
    discard.trigger()
    assert "Record" in bar.record.text()
    assert bar.record.menu() is None
    bar.record.click()
    assert recorder.recording
    assert not reported.errors


def test_a_recording_that_cannot_be_written_is_kept(
    qtbot: QtBot, played: Controller, reported: Reported, tmp_path: Path
) -> None:
    record(played)
    save(qtbot, played, tmp_path / "absent" / "take.wav", "absent")
    assert "Unsaved" in played.window.instrument.bar.record.text()
    save(qtbot, played, tmp_path / "take.wav")


def test_rate_format_and_level_are_those_of_the_dialog(
    qtbot: QtBot, played: Controller, reported: Reported, tmp_path: Path
) -> None:
    record(played)
    wav = dialog_of(played).wav
    for box, data in ((wav.rate, 44_100), (wav.bits, "16")):
        box.setCurrentIndex(box.findData(data))
    wav.normalise.setChecked(True)
    save(qtbot, played, tmp_path / "take.wav")
    info = soundfile.info(tmp_path / "take.wav")
    assert (info.samplerate, info.subtype) == (44_100, "PCM_16")
    assert abs(soundfile.read(tmp_path / "take.wav")[0]).max() == pytest.approx(10 ** (-1 / 20), abs=1e-4)


@pytest.mark.parametrize("button", ["_pickup", "_stereo"])
def test_it_is_recorded_as_it_is_heard(
    qtbot: QtBot, played: Controller, reported: Reported, tmp_path: Path, button: str
) -> None:
    """Not as the patch was saved."""
    played.patches.change("knobs.decay", 10.0)
    played.session.update(pickup="displacement")  # at the bridge both sides hear the same
    control = getattr(played.window.transport, button)
    change = control.click if button == "_stereo" else lambda: control.activated.emit(control.findData("velocity"))
    for name, turn in {"before.wav": lambda: None, "after.wav": change}.items():
        turn()
        played.patches.recordings.record()
        played.window.instrument.pressed.emit(60, 100, None)  # and held: when it is released would differ
        qtbot.wait(100)  # the string is damped where the recording ends
        played.patches.recordings.record()
        played.window.instrument.released.emit(60, None)
        save(qtbot, played, tmp_path / name, f"{name} and")
    before, after = (soundfile.read(tmp_path / name, always_2d=True)[0] for name in ("before.wav", "after.wav"))
    assert before.shape[1] == after.shape[1] == 2
    side = {"_pickup": 0, "_stereo": 1}[button]  # the left one stays where it was
    assert np.abs(before[:4_800, side] - after[:4_800, side]).max() > 0.05 * np.abs(before).max()


@pytest.mark.parametrize(("source", "words"), [("truth", "the truth"), ("difference", "at +40 dB")])
def test_the_source_that_was_heard_is_written(
    qtbot: QtBot, played: Controller, reported: Reported, tmp_path: Path, source: str, words: str
) -> None:
    played.session.update(a=source, heard="a", difference_gain_db=40.0)
    record(played)
    assert words in save(qtbot, played, tmp_path / "take.wav")
    origin = read_origin(tmp_path / "take.wav")
    assert isinstance(origin, InstrumentSound)
    assert (origin.instrument, origin.preset) == ("Steel-string acoustic", "studio_any_string")
    assert (origin.source, origin.midi) == (source, "take.mid")
    assert (origin.difference_gain_db, origin.rate_hz) == (40.0 if source == "difference" else 0.0, 48_000)
    assert origin.version == program_version()
    assert origin.recorded is not None
    age = datetime.now(UTC) - datetime.fromisoformat(origin.recorded)
    assert timedelta(0) <= age < timedelta(minutes=10)


def test_a_recording_that_is_dropped_says_what_it_is_and_changes_nothing(
    qtbot: QtBot, played: Controller, reported: Reported, tmp_path: Path
) -> None:
    """It is neither a recipe nor a body."""
    record(played)
    save(qtbot, played, tmp_path / "take.wav")
    before = played.session.choices
    played.take_file(tmp_path / "take.wav")
    notice = played.window.notices.text
    assert "take.wav: is a recording of Steel-string acoustic (the model, 20" in notice
    assert "its notes are in the MIDI file take.mid" in notice
    assert played.session.choices == before
    assert not own_bodies().exists()


def test_that_a_soloed_mode_is_not_recorded_alone_is_reported(played: Controller, reported: Reported) -> None:
    played.session.update(solo=3)
    record(played)
    assert reported.good == ["The recording has all modes, although mode 3 is soloed."]


LOST = "Recording not saved"
BUSY = "Export under way"


@pytest.mark.parametrize("answer", [Qt.Key.Key_Escape, Qt.Key.Key_Return, Qt.Key.Key_Space, "Cancel", "Save"])
@pytest.mark.parametrize("ended", [False, True])
def test_no_key_closes_the_window_over_a_recording(
    played: Controller, reported: Reported, answer: str | Qt.Key, ended: bool
) -> None:
    record(played)
    if not ended:
        played.patches.recordings.discard()
        played.patches.recordings.record()
        play(played)
    assert close(played, answer) == [LOST]
    assert played.window.isVisible()
    assert played.patches.recordings.unsaved


def test_a_recording_can_be_discarded_to_close(played: Controller, reported: Reported) -> None:
    record(played)
    assert close(played, "Discard") == [LOST]
    assert not played.window.isVisible()
    assert left_journals(recordings_folder()) == []


def test_save_closes_once_it_is_saved_and_not_before(
    qtbot: QtBot, played: Controller, reported: Reported, tmp_path: Path
) -> None:
    played.patches.recordings.record()
    play(played)
    close(played, "Save")
    save(qtbot, played, tmp_path / "absent" / "take.wav", "absent")  # it cannot be written
    assert played.window.isVisible()
    close(played, "Save")
    dialog_of(played).close_button.click()  # the user thinks better of it
    record_more = played.patches.recordings
    record_more.save_asked.emit()
    save(qtbot, played, tmp_path / "kept.wav")
    assert played.window.isVisible()
    record(played)
    close(played, "Save")
    dialog = dialog_of(played)
    dialog.performance.file.edit.setText(str(tmp_path / "take.wav"))
    dialog.save.click()
    qtbot.waitUntil(lambda: not played.window.isVisible())
    assert {path.name for path in tmp_path.glob("take.*")} == {"take.wav", "take.mid"}
    assert left_journals(recordings_folder()) == []


def test_a_window_that_is_ended_keeps_the_recording_on_disk(played: Controller, reported: Reported) -> None:
    record(played)
    latest = played.patches.recordings.latest
    played.window.may_close = lambda: True  # as by a signal
    played.window.close()
    (journal,) = left_journals(recordings_folder())
    found = journal.read()
    assert latest is not None and found is not None
    assert (found.events, found.patch, found.source) == (latest.events, latest.patch, latest.source)
    assert found.recorded == latest.recorded
    journal.delete()


@pytest.mark.parametrize("recording", [False, True])
def test_what_was_left_is_read_in_the_background_and_asked_about_where_nobody_records(
    qtbot: QtBot, played: Controller, reported: Reported, monkeypatch: pytest.MonkeyPatch, recording: bool
) -> None:
    """An hour of notes and turned knobs takes seconds to read."""
    recordings, read, readers = played.patches.recordings, Journal.read, []
    patch = played.patches.patch
    assert patch is not None
    journal = Journal.begun(recordings_folder(), datetime.now(UTC))
    journal.write([TimedEvent(0.0, PatchTurned(patch)), TimedEvent(0.0, NoteOn(60, 100))])
    journal.close()

    def noted(journal: Journal, check: Callable[[], None] = lambda: None) -> Played | None:
        readers.append(threading.current_thread())
        return read(journal, check)

    monkeypatch.setattr(Journal, "read", noted)
    if recording:
        recordings.record()
    with answered(*([] if recording else [Qt.Key.Key_Return])) as asked:
        recordings.offer_left()
        qtbot.waitUntil(lambda: bool(reported.good if recording else asked))
        qtbot.waitUntil(lambda: recording or recordings.latest is not None)
    assert asked == ([] if recording else ["Recover what was played?"])
    assert readers and threading.main_thread() not in readers
    if recording:
        assert "next start" in reported.good[-1]
        recordings.discard()
        (left,) = left_journals(recordings_folder())  # that of the recording under way has its own lock
        left.delete()


def test_the_window_is_not_closed_over_an_export_without_a_question(
    qtbot: QtBot, played: Controller, reported: Reported, tmp_path: Path
) -> None:
    """An hour of playing takes minutes. Its notes are there at once; its sound is given up if the user says so."""
    record(played)
    recordings = played.patches.recordings
    latest = recordings.latest
    assert latest is not None
    hour = [TimedEvent(float(second), NoteOn(60, 100)) for second in range(3_600)]
    recordings._unsaved = {replace(latest, events=(latest.events[0], *hour)): recordings._unsaved[latest]}
    played.exports.refresh()
    save(qtbot, played, tmp_path / "take.wav", "Rendering")
    qtbot.waitUntil((tmp_path / "take.mid").is_file)
    for answer in (Qt.Key.Key_Escape, Qt.Key.Key_Return, "Stay", "Finish first"):
        assert close(played, answer) == [BUSY]
        assert played.window.isVisible() and played.exports.busy
    assert close(played, "Cancel export", "Discard") == [BUSY, LOST]
    assert not played.window.isVisible()
    assert [path.name for path in tmp_path.iterdir() if "take" in path.name] == ["take.mid"]


def test_an_export_that_is_finished_first_closes_the_window(
    qtbot: QtBot, played: Controller, reported: Reported, tmp_path: Path
) -> None:
    record(played)
    recordings = played.patches.recordings
    latest = recordings.latest
    assert latest is not None
    longer = [TimedEvent(float(second), NoteOn(60, 100)) for second in range(60)]
    recordings._unsaved = {replace(latest, events=(latest.events[0], *longer)): recordings._unsaved[latest]}
    played.exports.refresh()
    save(qtbot, played, tmp_path / "take.wav", "Rendering")
    assert close(played, "Finish first") == [BUSY]
    qtbot.waitUntil(lambda: not played.window.isVisible())
    assert {path.name for path in tmp_path.glob("take.*")} == {"take.wav", "take.mid"}


def test_enter_replaces_no_file(qtbot: QtBot, played: Controller, reported: Reported, tmp_path: Path) -> None:
    (tmp_path / "take.wav").write_bytes(b"mine")
    record(played)
    dialog = dialog_of(played)
    edit = dialog.performance.file.edit
    edit.setFocus()
    edit.selectAll()
    QTest.keyClicks(edit, str(tmp_path / "take.wav"))
    for _ in range(3):  # before the name has settled, and after
        QTest.keyClick(edit, Qt.Key.Key_Return)
        qtbot.waitUntil(lambda: dialog.save.text() == "Replace")
    assert dialog.job is None and dialog.isVisible()
    assert (tmp_path / "take.wav").read_bytes() == b"mine"
    dialog.save.click()
    qtbot.waitUntil(lambda: "Saved" in dialog.state.text())


def test_escape_closes_the_result_of_an_export_from_the_window(
    qtbot: QtBot, played: Controller, reported: Reported, tmp_path: Path
) -> None:
    """The window has the keyboard since the export began, so that one plays on."""
    played.session.update(solo=3)
    record(played)
    save(qtbot, played, tmp_path / "take.wav")
    played.window.activateWindow()
    view = played.string.view
    view.setFocus()
    qtbot.waitUntil(view.hasFocus)
    qtbot.keyClick(view, Qt.Key.Key_Escape)
    assert played.exports.dialog is None
    assert played.session.choices.solo == 3, "Escape does one thing"
    assert view.hasFocus()
    qtbot.keyClick(view, Qt.Key.Key_Escape)
    assert played.session.choices.solo == 0
