"""Playing and notes become files: as they are heard, kept until they are written, and back when they are dropped."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QToolButton

from app.export.choices import ExportChoices
from app.export.journal import Journal, left_journals, recordings_folder
from app.export.played import Played
from app.export.recipe import read_origin, read_recipe
from app.export.sampled.choices import SampledChoices
from app.export.sampled.plan import SampledPlan
from app.instruments.library import find_instrument
from app.player.bodies import own_bodies
from app.player.events import InstrumentTurned, NoteOff, NoteOn, TimedEvent, bend_range
from app.player.midi_file import read_midi
from app.player.offline import render_note
from app.shared.version import program_version
from app.views.dialogs.export_dialog import ExportDialog
from app.window.settings import load_settings
from engine.presets import find_string, load_preset, read_string
from engine.presets.finding import SHIPPED
from tests.app.places import files_in
from tests.app.questions import answered
from tests.app.window.conftest import Open
from tests.app.window.driver import CONTROL, KEY, LEFT, SHIFT, Window, choose

LOST, BUSY = "Recording not saved", "Export under way"
GUITAR = find_instrument("Classical guitar").instrument


@pytest.fixture
def briefly(tmp_path: Path) -> dict[str, Any]:
    """The settings of a dialog that was last set to short sounds."""
    note = ExportChoices(until_decayed=False, seconds=0.3, normalise=False)
    sampled = SampledChoices(keys=(60, 61), layers=1, seconds=0.2)
    return {"export": note, "sampled": sampled, "files": files_in(tmp_path)}


@pytest.fixture
def short(opened: Open, briefly: dict[str, Any]) -> Window:
    made = opened("studio_any_string", settings=briefly, instrument=GUITAR)
    made.wait_for_keys()
    return made


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
    """The takes in the menu beside Record, each with what can be done with it."""
    submenus = [action.menu() for action in w.window.instrument.bar.takes.actions() if action.menu() is not None]
    rows = [menu for menu in submenus if menu.actions()[0].text() == "Play"]  # type: ignore[union-attr]
    return {menu.title(): {action.text(): action for action in menu.actions()} for menu in rows}  # type: ignore[union-attr]


def discard(w: Window) -> None:
    """Delete the latest take."""
    with answered("Delete") as asked:
        next(iter(takes(w).values()))["Delete …"].trigger()
    assert asked == ["Delete the take?"]


def close(w: Window, *answers: str | Qt.Key) -> list[str]:
    """Close the window and answer its questions; their titles."""
    with answered(*answers) as asked:
        w.window.close()
    return asked


def test_playing_is_recorded_as_it_is_heard_and_a_dropped_recording_changes_nothing(
    guitar: Window, tmp_path: Path
) -> None:
    guitar.key(KEY.Key_R, CONTROL)
    guitar.key(KEY.Key_R, CONTROL)
    assert "Nothing was played" in guitar.said[-1]
    for source, words in (("model", "of the model"), ("truth", "the truth"), ("difference", "at +40 dB")):
        guitar.change(a=source, heard="a", difference_gain_db=40.0, solo=3)
        record(guitar)
        assert "1 note in" in dialog_of(guitar).performance.what.text()
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
        assert (origin.instrument, origin.preset) == ("Steel-string acoustic", "studio_any_string")
        assert (origin.source, origin.midi, origin.version) == (source, f"{source}.mid", program_version())
        assert (origin.difference_gain_db, origin.rate_hz) == (40.0 if source == "difference" else 0.0, 48_000)
        age = datetime.now(UTC) - datetime.fromisoformat(origin.recorded)
        assert timedelta(0) <= age < timedelta(minutes=10)
    before = guitar.choices
    guitar.drop(tmp_path / "model.wav")
    assert "model.wav: is a recording of Steel-string acoustic (the model, 20" in guitar.window.notices.text
    assert "its notes are in the MIDI file model.mid" in guitar.window.notices.text
    assert guitar.choices == before and not own_bodies().exists(), "it is neither a recipe nor a body"
    record(guitar)
    save(guitar, tmp_path / "small.flac")
    assert (tmp_path / "small.mid").is_file() and soundfile.info(tmp_path / "small.flac").subtype == "PCM_24"
    guitar.drop(tmp_path / "small.flac")
    assert "small.flac: is a recording of Steel-string acoustic" in guitar.window.notices.text
    record(guitar)
    wav = dialog_of(guitar).wav
    choose(wav["rate_hz"], 44_100)
    choose(wav["format"], "wav 16")
    wav["normalise"].setChecked(True)
    save(guitar, tmp_path / "cd.wav")
    info = soundfile.info(tmp_path / "cd.wav")
    assert (info.samplerate, info.subtype) == (44_100, "PCM_16")
    assert abs(soundfile.read(tmp_path / "cd.wav")[0]).max() == pytest.approx(10 ** (-1 / 20), abs=1e-4)


def test_a_recording_hears_the_pick_up_and_the_points_of_the_window(guitar: Window, tmp_path: Path) -> None:
    """Not those with which the instrument was saved."""
    guitar.controller.instruments.change("knobs.decay", 10.0)
    guitar.change(pickup="displacement", stereo=True)  # at the bridge both sides hear the same
    changes: dict[str, Callable[[], object]] = {
        "before.wav": lambda: None,
        "mono.wav": guitar.find(QToolButton, "Stereo").click,
        "velocity.wav": lambda: choose(guitar.find(QComboBox, "Pick-up"), "velocity"),
    }
    sounds = []
    for name, change in changes.items():
        change()
        guitar.window.instrument.bar.record.click()
        guitar.play(60, hold=True)  # when it is released would differ
        guitar.wait(lambda: guitar.struck[-1].seconds > 0.1)
        guitar.window.instrument.bar.record.click()
        guitar.window.instrument.released.emit(60, None)
        save(guitar, tmp_path / name, f"{name} and")
        sounds.append(soundfile.read(tmp_path / name, always_2d=True)[0][:4_800])
        assert sounds[-1].shape[1] == 2
    for before, after, side in ((sounds[0], sounds[1], 1), (sounds[1], sounds[2], 0)):
        assert np.abs(before[:, side] - after[:, side]).max() > 0.05 * np.abs(before).max()


def test_a_recording_is_kept_until_it_is_saved_or_discarded_and_replaces_no_file_unasked(
    guitar: Window, tmp_path: Path
) -> None:
    record(guitar)
    guitar.controller.instruments.choose("concert_harp")  # it was played by the other one
    for _ in range(2):
        (words,) = takes(guitar)
        assert words.startswith("Steel-string acoustic:") and words.endswith("1 note, not saved")
        dialog_of(guitar).reject()
        takes(guitar)[words]["Save …"].trigger()
    save(guitar, tmp_path / "absent" / "take.wav", "absent")
    assert list(takes(guitar)) == [words]
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
    assert {path.name for path in tmp_path.glob("take 1.5*")} == {"take 1.5.wav", "take 1.5.mid"}
    origin: Any = read_origin(tmp_path / "take 1.5.wav")
    assert list(takes(guitar)) == [words.replace("Steel-string acoustic:", "take 1.5:").removesuffix(", not saved")]
    assert origin.instrument == "Steel-string acoustic"
    view = guitar.controller.string.view
    guitar.change(solo=3)
    guitar.window.activateWindow()
    view.setFocus()  # the window has the keyboard since the export began, so that one plays on
    guitar.wait(view.hasFocus)
    for solo in (3, 0):
        guitar.key(KEY.Key_Escape, on=view)
        assert guitar.controller.exports.dialog is None and guitar.choices.solo == solo, "Escape does one thing"


@pytest.mark.parametrize("ended", [False, True])
def test_no_key_closes_the_window_over_a_recording_and_save_closes_it_once_it_is_saved(
    guitar: Window, tmp_path: Path, ended: bool
) -> None:
    record(guitar)
    if not ended:
        discard(guitar)
        guitar.window.instrument.bar.record.click()
        guitar.play(60)
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
        assert {path.name for path in tmp_path.glob("Steel*")} == {
            f"Steel-string acoustic{end}" for end in (".wav", ".mid")
        }
    assert not guitar.window.isVisible() and left_journals(recordings_folder()) == []


def test_a_window_that_is_ended_keeps_the_recording_which_is_read_aside_and_offered(
    guitar: Window, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not over another recording. An hour of notes and turned knobs takes seconds to read."""
    recordings, read, readers = guitar.controller.instruments.recordings, Journal.read, list[object]()
    journal = Journal.begun(recordings_folder(), datetime.now(UTC))
    journal.write([TimedEvent(0.0, InstrumentTurned(guitar.instrument)), TimedEvent(0.0, NoteOn(60, 100))])
    journal.close()

    def noted(journal: Journal, check: Callable[[], None] = lambda: None) -> Played | None:
        readers.append(threading.current_thread())
        return read(journal, check)

    monkeypatch.setattr(Journal, "read", noted)
    guitar.window.instrument.bar.record.click()
    with answered() as asked:
        recordings.offer_left()
        guitar.wait(lambda: guitar.said and "next start" in guitar.said[-1])
    guitar.window.instrument.bar.record.click()
    with answered(KEY.Key_Return) as asked:
        recordings.offer_left()
        guitar.wait(lambda: recordings.offered is not None)
    assert asked == ["Recover what was played?"] and readers and threading.main_thread() not in readers
    latest = recordings.offered
    guitar.close()  # as by a signal
    (left,) = left_journals(recordings_folder())
    found = left.read()
    assert latest is not None and found is not None and found.recorded == latest.played.recorded
    assert (found.events, found.instrument, found.source) == (
        latest.played.events,
        latest.played.instrument,
        latest.played.source,
    )
    left.delete()


def play_long(w: Window, notes: int) -> None:
    """A recording of so many seconds, in place of the one of a note: as a journal of an earlier run."""
    record(w)
    recordings = w.controller.instruments.recordings
    latest = recordings.offered
    assert latest is not None
    journal = Journal.begun(recordings_folder(), datetime.now(UTC))
    journal.write([TimedEvent(0.0, InstrumentTurned(latest.played.instrument))])
    journal.write([TimedEvent(float(second), NoteOn(60, 100)) for second in range(notes)])
    journal.close()
    discard(w)
    with answered(KEY.Key_Return):
        recordings.offer_left()
        w.wait(lambda: recordings.offered is not None)


@pytest.mark.parametrize("finish", [True, False])
def test_the_window_is_not_closed_over_an_export_without_a_question(
    guitar: Window, tmp_path: Path, finish: bool
) -> None:
    """Its notes are there at once; its sound is given up, or finished first, as the user says."""
    play_long(guitar, 20 if finish else 3_600)
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
    assert {path.name for path in tmp_path.glob("take.*")} == {"take.mid", *(["take.wav"] if finish else [])}


def test_a_note_is_exported_through_its_instrument_with_turned_knobs_and_comes_back(
    short: Window, tmp_path: Path
) -> None:
    preset = load_preset(SHIPPED / "studio_any_string.safetensors")
    for instrument in (GUITAR, GUITAR.with_value("pluck.position", 0.4)):
        short.wait_for_keys()
        short.play(60)
        short.wait(lambda: short.struck[-1].known)
        short.wait_for_string()
        short.change(instrument=instrument)  # a knob that is turned since
        short.key(KEY.Key_E, CONTROL)
        save(short, words="Saved")
        (file,) = tmp_path.glob("*.wav")
        assert file.name == "Classical guitar C4 hard.wav"
        struck: Any = read_recipe(file).struck
        assert (struck.instrument, struck.key, struck.velocity) == (GUITAR.name, 60, 100)
        heard, written = render_note(instrument, preset, 60, 100, 9.0, 0.3, 48_000), soundfile.read(file)[0]
        np.testing.assert_allclose(written[:-960], heard[:-960], atol=2.0**-22)  # the end is faded
        short.change(preset="first")
        short.drop(file)
        assert short.choices.played == GUITAR
        assert ("instrument Classical guitar is not the one" in short.window.notices.text) == (instrument != GUITAR)
        file.unlink()


def test_the_string_that_is_chosen_is_exported_and_comes_back(
    opened: Open, briefly: dict[str, Any], tmp_path: Path
) -> None:
    short, string = opened("studio_any_string", settings=briefly), read_string(find_string("steel_g3"))
    short.change(preset="studio_any_string", string=string, amplitude_mm=0.05, shape="triangular", position=0.2)
    short.key(KEY.Key_E, CONTROL)
    save(short, words="Saved")
    (file,) = tmp_path.glob("*.wav")
    assert file.name == "Any string G3 soft.wav"
    with soundfile.SoundFile(file) as sound:
        assert json.loads(sound.comment)["string"]["tension_n"] == string.tension_n
        samples, rate_hz = sound.read(), sound.samplerate
    spectrum = np.abs(np.fft.rfft(samples * np.hanning(len(samples)), 2**18))
    peak_hz = spectrum[: round(300 / rate_hz * 2**18)].argmax() * rate_hz / 2**18
    assert peak_hz == pytest.approx(string.undamped_frequency(1) / (2 * np.pi), rel=2e-3)
    short.change(preset="first")
    short.drop(file)
    assert (short.choices.preset, short.choices.string) == ("studio_any_string", string)


def test_what_cannot_be_exported_says_so(short: Window) -> None:
    short.change(preset="first")
    short.wait(lambda: short.performance.at_hand)  # else the window itself would tell that the file is gone
    short.controller.library.find("first").path.unlink()  # type: ignore[union-attr]
    short.window.transport.export.click()
    save(short, words="first.safetensors")
    dialog_of(short).reject()
    short.change(preset="gone")
    short.change(instrument=None)
    for name, words in (("export", "There is no preset to export"), ("sampler", "There is no instrument to export")):
        short.window.action[name].trigger()
        assert short.controller.exports.dialog is None and words in short.said[-1]


def open_sampler(w: Window) -> ExportDialog:
    w.window.activateWindow()
    w.key(KEY.Key_E, CONTROL | SHIFT)
    return dialog_of(w)


def test_the_instrument_is_exported_for_samplers_while_the_window_plays_and_choices_are_remembered(
    short: Window, tmp_path: Path
) -> None:
    dialog = open_sampler(short)
    assert dialog.isVisible() and not dialog.isModal() and open_sampler(short) is dialog
    for name in ("classical_guitar", "concert_harp"):
        short.choose(name)
        assert dialog.sampler.what.text().startswith(short.instrument.name)
    dialog.save.click()
    short.qtbot.keyPress(short.window, KEY.Key_A)
    short.wait(short.keys.sounding)
    short.qtbot.keyRelease(short.window, KEY.Key_A)
    short.wait(lambda: "Saved" in dialog.state.text() and "Concert_harp.sfz" in dialog.state.text())
    samples = sorted((tmp_path / "Concert_harp_samples").glob("*.flac"))
    assert [path.stem for path in samples] == [
        zone.stem for zone in SampledPlan(short.instrument, (60, 61), layers=1).zones
    ]
    assert soundfile.info(samples[0]).frames == 9_600
    dialog.sampler["layers"].setValue(7)
    assert short.controller.settings().sampled.layers == 7, "should the process be killed now"
    dialog.close()
    assert open_sampler(short).sampler["layers"].value() == 7
    short.close()
    remembered = load_settings(tmp_path / "settings.json")[0]
    assert (remembered.sampled.layers, remembered.sampled.keys) == (7, (60, 61))
    assert remembered.files.folders["sampler"] == tmp_path


def test_keys_and_shortcuts_work_while_an_export_runs_and_it_is_cancelled_by_a_question(
    short: Window, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = threading.Event()

    def export(plan: object, out: object, render: object, progress: Callable[[float], None]) -> None:
        begun.set()
        while True:
            progress(0.0)
            time.sleep(0.01)

    monkeypatch.setattr("app.export.sampled.job.export_sampled", export)
    dialog = open_sampler(short)
    short.wait(dialog.isActiveWindow)
    for cancelled in ("by Escape", "by closing"):
        begun.clear()
        short.qtbot.mouseClick(dialog.save, LEFT)
        short.wait(begun.is_set)
        short.wait(short.window.isActiveWindow)  # without a click
        focused = QApplication.activeWindow().focusWidget() or short.window
        short.qtbot.keyPress(focused, KEY.Key_A)
        short.wait(short.keys.sounding)
        short.qtbot.keyRelease(focused, KEY.Key_A)
        looped = short.choices.loop
        short.key(KEY.Key_L, CONTROL, on=focused)
        assert short.choices.loop != looped
        if cancelled == "by Escape":
            dialog.activateWindow()
            short.wait(dialog.isActiveWindow)
            short.change(solo=2)
            with answered("Cancel export"):
                short.key(KEY.Key_Escape, on=dialog.focusWidget() or dialog)
            short.wait(lambda: "Cancelled" in dialog.state.text())
            assert short.choices.solo == 2
            looped = short.choices.loop
            short.key(KEY.Key_L, CONTROL, on=dialog.sampler)
            assert short.choices.loop == looped, "its own keys again"
    assert close(short, KEY.Key_Return) == [BUSY] and short.window.isVisible()
    short.window.activateWindow()
    short.wait(short.window.isActiveWindow)
    with answered("Cancel export"):
        short.key(KEY.Key_Q, CONTROL)
    assert not short.window.isVisible()
