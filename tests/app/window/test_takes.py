"""Take after take: counted in, written where the first one is, listed, played again, renamed and deleted."""

from __future__ import annotations

import time
from pathlib import Path
from types import SimpleNamespace

import mido
import pytest
import soundfile
from PySide6.QtWidgets import QInputDialog

from app.player.events import KEYS, NoteOff, NoteOn
from app.player.midi_file import read_midi
from app.playing import playback, recorder
from app.playing.playback import AHEAD_S
from app.window.settings import load_settings
from engine.voices import Mixer, Voice
from tests.app.questions import answered
from tests.app.window.driver import CONTROL, KEY, SHIFT, Window
from tests.app.window.test_exports import dialog_of, record, save, takes


def chosen(w: Window, take: int, what: str) -> None:
    """Choose what is done with a take, of which the latest is 0."""
    list(takes(w).values())[take][what].trigger()


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir() if path.suffix in (".wav", ".mid")}


def test_takes_are_written_where_the_first_was_saved_and_their_own_files_alone_are_renamed_and_deleted(
    guitar: Window, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "takes"
    folder.mkdir()
    (folder / "Steel-string acoustic 2.mid").write_bytes(b"mine")
    record(guitar)
    save(guitar, folder / "Steel-string acoustic.wav")
    dialog_of(guitar).reject()
    for number in (3, 4):
        record(guitar)
        guitar.wait(lambda: "saved" not in next(iter(takes(guitar))))
        assert guitar.said[-1].startswith(f"Saved {folder / f'Steel-string acoustic {number}.wav'} and ")
        assert guitar.controller.exports.dialog is None
    assert [title.split(":")[0][-10:] for title in takes(guitar)] == ["acoustic 4", "acoustic 3", "g acoustic"]
    typed = iter([("a/b", True), ("Steel-string acoustic 2", True), ("Best", True)])
    asked: list[str] = []
    monkeypatch.setattr(QInputDialog, "getText", lambda _, title, words, text="": asked.append(words) or next(typed))
    chosen(guitar, 0, "Rename …")
    assert "must not" in asked[1] and "Steel-string acoustic 2.mid is there already" in asked[2]
    assert {"Best.wav", "Best.mid"} <= names(folder) and next(iter(takes(guitar))).startswith("Best:")
    (folder / "Best.mid").write_bytes(b"edited in another program")
    before = names(folder)
    with answered("Keep", "Delete") as questions:
        for _ in range(2):
            chosen(guitar, 0, "Delete …")
            assert names(folder) == (before if len(questions) == 1 else before - {"Best.wav"})
    assert len(takes(guitar)) == 2 and (folder / "Steel-string acoustic 2.mid").read_bytes() == b"mine"
    (folder / "Steel-string acoustic 3.wav").unlink()
    folder.rename(tmp_path / "moved")
    record(guitar)
    guitar.wait(lambda: "menu beside Record" in guitar.said[-1])
    assert "make the folder first" in guitar.said[-1] and next(iter(takes(guitar))).endswith("not saved")
    assert guitar.controller.instruments.recordings.unsaved
    record(guitar)  # asks for another place
    save(guitar, tmp_path / "elsewhere.wav")


def test_a_take_is_played_again_through_its_instrument_with_the_knobs_that_were_turned(
    guitar: Window, tmp_path: Path
) -> None:
    record(guitar)
    save(guitar, tmp_path / "first.wav")
    dialog_of(guitar).reject()
    instrument = guitar.instrument
    guitar.window.instrument.bar.record.click()
    guitar.play(64, hold=True)
    guitar.controller.instruments.change("level_db", -9.0)
    guitar.wait(lambda: guitar.struck[-1].seconds > 0.4)
    guitar.window.instrument.released.emit(64, None)
    guitar.window.instrument.bar.record.click()
    guitar.wait(lambda: "saved" not in next(iter(takes(guitar))))
    guitar.choose("concert_harp")
    guitar.qtbot.wait(600)  # or both choices were one step of undo
    guitar.struck.clear()
    chosen(guitar, 0, "Play")
    guitar.wait(lambda: [note.event.key for note in guitar.struck] == [64])
    assert guitar.instrument == instrument and guitar.struck[0].instrument == instrument
    guitar.wait(lambda: guitar.keys.player is not None and guitar.keys.player.instrument.level_db == -9.0)
    guitar.wait(lambda: not guitar.controller.instruments.playing)
    guitar.wait(lambda: guitar.keys.player is not None and guitar.keys.player.instrument == instrument)
    guitar.session.undo()
    assert guitar.instrument.name == "Concert harp"


def test_a_counted_recording_begins_at_the_beat_and_is_sample_equal_to_one_without_clicks(
    guitar: Window, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = SimpleNamespace(monotonic=lambda: now_s)
    monkeypatch.setattr(recorder, "time", clock)
    monkeypatch.setattr(playback, "time", clock)
    clicks, add = list[Voice](), Mixer.add

    def note_added(mixer: Mixer, *voices: Voice) -> None:
        clicks.extend(voices if mixer is guitar.notes.mixer else ())
        add(mixer, *voices)

    monkeypatch.setattr(Mixer, "add", note_added)
    recordings, sounds, now_s = guitar.controller.instruments.recordings, [], 1000.0
    actions = {each.text(): each for each in guitar.window.instrument.bar.takes.actions()}
    for counted in (False, True):
        if counted:
            actions["Metronome"].trigger()
            guitar.window.instrument.bar.takes.choose({"count_in_bars": 1})
            guitar.window.instrument.bar.takes.choose({"tempo_bpm": 96})
        guitar.key(KEY.Key_R, CONTROL)
        beat_s = now_s = now_s + AHEAD_S + guitar.notes.buffer_s + (4 * 60 / 96 if counted else 0.0)
        early = [(-1.0, NoteOn(50, 90, KEYS)), (-0.9, NoteOff(50, KEYS))] if counted else []
        for after_s, event in (
            *early,
            (-0.05 if counted else 0.0, NoteOn(64, 70, KEYS)),
            (0.5, NoteOn(60, 100, KEYS)),
            (0.9, NoteOff(60, KEYS)),
            (1.0, NoteOff(64, KEYS)),
        ):
            now_s = beat_s + after_s
            guitar.controller.inputs.play(event)
        now_s = beat_s + 1.1
        guitar.key(KEY.Key_R, CONTROL)
        if not counted:
            assert clicks == []
            save(guitar, tmp_path / "plain.wav")
        else:
            guitar.wait(lambda: not recordings.unsaved)
        (file,) = (path for path in tmp_path.glob("*.wav") if counted == (path.stem != "plain"))
        sounds.append(soundfile.read(file)[0])
        (track,) = mido.MidiFile(file.with_suffix(".mid")).tracks
        assert [each.tempo for each in track if each.type == "set_tempo"] == [625_000 if counted else 500_000]
        on_s = [each.time_s for each in read_midi(file.with_suffix(".mid")) if isinstance(each.event, NoteOn)]
        assert on_s == pytest.approx([0.0, 0.5], abs=1e-3), "a stroke just before the beat is on it"
    assert len(clicks) >= 2 and all(voice.record["begin_at"] > 0 for voice in clicks)
    assert len(sounds[0]) == len(sounds[1]) and (sounds[0] == sounds[1]).all() and abs(sounds[0]).max() > 0.01
    guitar.close()
    remembered = load_settings(tmp_path / "settings.json")[0].record
    assert (remembered.metronome, remembered.count_in_bars, remembered.tempo_bpm) == (True, 1, 96)


def test_the_menu_of_takes_opens_by_its_key_in_any_window(guitar: Window) -> None:
    menu = guitar.window.instrument.bar.takes
    for width in (1280, 760):
        guitar.window.resize(width, 720)
        guitar.key(KEY.Key_R, CONTROL | SHIFT)
        assert menu.isVisible()
        menu.close()
    started_s = time.monotonic()
    guitar.window.instrument.bar.takes.choose({"count_in_bars": 2})
    guitar.window.instrument.bar.record.click()
    guitar.wait(lambda: guitar.window.instrument.bar.record.text().startswith("■  −"))
    assert time.monotonic() - started_s < 4.0
    guitar.window.instrument.bar.record.click()
    assert "Nothing was played" in guitar.said[-1]
