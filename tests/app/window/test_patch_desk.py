"""The instrument in the window: keys, patches and what they show."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import soundfile
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog, QInputDialog
from pytestqt.qtbot import QtBot

from app.instrument.events import NoteOff, NoteOn, TimedEvent
from app.instrument.midi_file import midi_bytes, read_midi
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import own_patches, read_patch
from app.patches.patch import Patch
from app.shared.key_names import note_name
from app.window.controller import Controller
from engine.presets.finding import SHIPPED
from engine.presets.of_string import STRINGS, read_string


@pytest.fixture
def played(
    qtbot: QtBot, preset_folder: Path, controller: Controller, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Controller:
    """With a patch, and the preset that plays it."""
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    shutil.copy(SHIPPED / "studio_any_string.safetensors", preset_folder)
    controller.library.refresh()
    controller.patches.choose("steel_string_acoustic")
    qtbot.waitUntil(lambda: controller.performance.live.ready, timeout=20_000)
    controller.window.setFocus()
    return controller


def press(qtbot: QtBot, controller: Controller, key: Qt.Key) -> None:
    qtbot.keyPress(controller.window, key)


def test_a_key_plays_a_pitch_and_the_window_shows_its_string(qtbot: QtBot, played: Controller) -> None:
    press(qtbot, played, Qt.Key.Key_A)
    assert played.performance.live.sounding().keys() == {48}
    qtbot.waitUntil(lambda: played.session.choices.string is not None, timeout=5_000)
    assert played.session.choices.preset == "studio_any_string"
    wanted_hz = 440 * 2 ** ((48 - 69) / 12)

    def shown() -> bool:
        take = played.performance.take
        return take is not None and take.complete and abs(take.fundamental_hz / wanted_hz - 1) < 1e-3

    qtbot.waitUntil(shown, timeout=20_000)
    qtbot.waitUntil(lambda: played.window.instrument.keys.level(48) > 0.1, timeout=5_000)
    qtbot.waitUntil(lambda: "error of this pluck" in played.window.error_label.text(), timeout=20_000)
    (struck,) = played.performance.live._player.sounding()  # type: ignore[union-attr]
    assert not struck.damped
    qtbot.keyRelease(played.window, Qt.Key.Key_A)
    qtbot.waitUntil(lambda: struck.damped, timeout=5_000)


def test_a_pluck_by_hand_is_as_loud_as_the_key_whose_string_it_is(qtbot: QtBot, played: Controller) -> None:
    played.window.instrument.pressed.emit(52, 100)
    (struck,) = played.performance.live._player.sounding()  # type: ignore[union-attr]
    qtbot.waitUntil(lambda: played.session.choices.string is not None, timeout=5_000)
    note = played.performance.strike(played.session.choices)
    assert note is not None
    assert note.stroke.gain == struck.gain != 1


def test_octave_and_velocity_keys(qtbot: QtBot, played: Controller) -> None:
    press(qtbot, played, Qt.Key.Key_X)
    press(qtbot, played, Qt.Key.Key_9)
    assert (played.session.choices.octave, played.session.choices.velocity) == (1, 127)
    press(qtbot, played, Qt.Key.Key_K)
    assert played.performance.live.sounding().keys() == {72}
    qtbot.keyRelease(played.window, Qt.Key.Key_K)


def test_places_are_still_there_without_pitches(qtbot: QtBot, played: Controller) -> None:
    played.session.update(keys_play="place")
    press(qtbot, played, Qt.Key.Key_A)
    assert played.performance.live.sounding() == {}
    assert played.performance.notes.ringing == 1


def test_keys_on_the_screen_play(qtbot: QtBot, played: Controller) -> None:
    played.window.instrument.pressed.emit(60, 100)
    assert played.performance.live.sounding().keys() == {60}
    played.window.instrument.released.emit(60)
    (struck,) = played.performance.live._player.sounding()  # type: ignore[union-attr]
    assert struck.damped


def test_keys_on_the_screen_and_of_the_computer_sound_together_on_a_guitars_patch(
    qtbot: QtBot, played: Controller
) -> None:
    played.patches.choose("oud")
    live = played.performance.live
    qtbot.waitUntil(lambda: live._player is not None and live._player.patch.mode == "guitar", timeout=5_000)
    for key in (60, 64):  # on one string
        played.window.instrument.pressed.emit(key, 100)
    press(qtbot, played, Qt.Key.Key_X)
    press(qtbot, played, Qt.Key.Key_G)
    assert live.sounding().keys() == {60, 64, 67}


def test_a_files_drums_are_left_out_and_told(qtbot: QtBot, played: Controller, tmp_path: Path) -> None:
    song = tmp_path / "song.mid"
    song.write_bytes(midi_bytes([TimedEvent(0.0, NoteOn(40, 90, 9)), TimedEvent(0.0, NoteOn(52, 90))]))
    informed: list[str] = []
    played.patches.informed.connect(informed.append)
    played.take_file(song)
    qtbot.waitUntil(lambda: 52 in played.performance.live.sounding(), timeout=5_000)
    assert 40 not in played.performance.live.sounding()
    assert informed == ["song.mid is played without its drums (channel 10)."]


def test_a_knob_changes_the_patch_and_undo_takes_it_back(played: Controller) -> None:
    before = played.session.choices.patch
    assert before is not None
    played.window.instrument.knobs.changed.emit("knobs.stiffness", 2.0)
    changed = played.session.choices.patch
    assert changed is not None
    assert changed.knobs.stiffness == 2.0
    played.window.instrument.knobs.changed.emit("knobs.stiffness", 99.0)
    assert played.session.choices.patch == changed
    played.history.undo()
    assert played.session.choices.patch == before
    played.history.redo()
    played.patches.revert()
    assert played.session.choices.patch == before


def test_previous_and_next_go_through_the_list(played: Controller) -> None:
    names = [entry.patch.name for entry in played.patches._entries]
    first = played.session.choices.patch
    assert first is not None
    played.patches.step(1)
    second = played.session.choices.patch
    assert second is not None
    assert names.index(second.name) == (names.index(first.name) + 1) % len(names)
    played.patches.step(-1)
    assert played.session.choices.patch == first


def test_a_patch_is_saved_renamed_and_deleted(played: Controller, monkeypatch: pytest.MonkeyPatch) -> None:
    played.patches.change("knobs.decay", 3.0)
    monkeypatch.setattr(QInputDialog, "getText", lambda *args, **words: ("Mine", True))
    played.patches.save()
    file = own_patches() / "mine.json"
    assert read_patch(file).knobs.decay == 3.0
    assert played.patches.entry is not None
    assert played.patches.entry.own
    played.patches.change("knobs.decay", 4.0)
    played.patches.save()  # the user's own, without a question
    assert read_patch(file).knobs.decay == 4.0
    monkeypatch.setattr(QInputDialog, "getText", lambda *args, **words: ("Yours", True))
    played.patches.rename()
    assert not file.exists()
    assert read_patch(own_patches() / "yours.json").name == "Yours"
    played.patches.delete("yours")
    assert not list(own_patches().glob("*.json"))


def test_dropped_files_are_played_and_chosen(qtbot: QtBot, played: Controller, tmp_path: Path) -> None:
    song = tmp_path / "song.mid"
    song.write_bytes(midi_bytes([TimedEvent(0.0, NoteOn(52, 90)), TimedEvent(30.0, NoteOff(52))]))
    played.take_file(song)
    qtbot.waitUntil(lambda: 52 in played.performance.live.sounding(), timeout=5_000)
    played.play_or_stop()
    assert not played.patches.playing
    harp = tmp_path / "harp.json"
    shutil.copy(PATCHES / "concert_harp.json", harp)
    played.take_file(harp)
    assert played.session.choices.patch == read_patch(harp)
    told: list[str] = []
    informed: list[str] = []
    played.patches.told.connect(told.append)
    played.patches.informed.connect(informed.append)
    played.take_file(STRINGS / "steel_g3.toml")
    assert played.session.choices.string is not None
    assert played.session.choices.string.parameters == read_string(STRINGS / "steel_g3.toml")
    assert "steel_g3.toml is plucked" in informed.pop()
    assert not told  # it is no error
    (tmp_path / "bad.toml").write_text("length_m = -1")
    played.take_file(tmp_path / "bad.toml")
    assert "bad.toml" in told.pop()
    (tmp_path / "short.toml").write_text("length_m = 0.65")
    played.take_file(tmp_path / "short.toml")
    assert "short.toml: area_m2, " in told[-1]
    assert "are missing" in told.pop()
    steel = (STRINGS / "steel_g3.toml").read_text()
    (tmp_path / "heavy.toml").write_text(steel.replace("d1_kg_m_s = 0.00098472", "d1_kg_m_s = 900.0"))
    played.take_file(tmp_path / "heavy.toml")
    assert "heavy.toml: " in told[-1]
    assert "overdamped" in told.pop()
    assert played.session.choices.string.parameters == read_string(STRINGS / "steel_g3.toml")
    (tmp_path / "slack.toml").write_text(steel.replace("tension_n = 74.173", "tension_n = 0.74173"))
    played.take_file(tmp_path / "slack.toml")
    assert "Beyond training: pitch" in informed.pop()
    (tmp_path / "bad.mid").write_bytes(b"no")
    played.take_file(tmp_path / "bad.mid")
    assert "bad.mid" in told[0]


def test_what_is_played_is_recorded_as_wav_and_midi(
    qtbot: QtBot, played: Controller, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    informed: list[str] = []
    played.patches.told.connect(told.append)
    played.patches.informed.connect(informed.append)
    played.patches.record()
    played.patches.record()
    assert "Nothing was played" in told[0]
    played.patches.record()
    played.window.instrument.pressed.emit(60, 100)
    played.window.instrument.released.emit(60)
    out = tmp_path / "take.wav"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *args, **words: (str(out), ""))
    played.patches.record()
    qtbot.waitUntil(lambda: len(informed) == 1, timeout=60_000)
    assert str(out) in informed[0]
    assert len(told) == 1  # to have written it is no error
    sound, rate_hz = soundfile.read(out)
    assert rate_hz == 48_000
    assert 0.001 < abs(sound).max() < 1
    assert [type(each.event) for each in read_midi(out.with_suffix(".mid"))] == [NoteOn, NoteOff]
    played.patches.write(tmp_path / "absent" / "take.wav", [TimedEvent(0.0, NoteOn(60, 100))])
    qtbot.waitUntil(lambda: len(told) == 2, timeout=60_000)
    assert "absent" in told[1]


def test_a_recording_replaces_no_file_that_nobody_asked_about(
    qtbot: QtBot, played: Controller, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "song.mid").write_bytes(b"mine")
    (tmp_path / "take.wav").write_bytes(b"mine")
    names = iter(["song.wav", "take", "take 1.5"])
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *args, **words: (str(tmp_path / next(names)), ""))
    told: list[str] = []
    informed: list[str] = []
    played.patches.told.connect(told.append)
    played.patches.informed.connect(informed.append)
    played.patches.record()
    played.window.instrument.pressed.emit(60, 100)
    played.window.instrument.released.emit(60)
    played.patches.record()
    qtbot.waitUntil(lambda: len(informed) == 1, timeout=60_000)
    assert "song.mid exists already" in told[0]
    assert "take.wav exists already" in told[1]
    assert (tmp_path / "song.mid").read_bytes() == (tmp_path / "take.wav").read_bytes() == b"mine"
    assert {path.name for path in tmp_path.glob("take 1.5*")} == {"take 1.5.wav", "take 1.5.mid"}


def test_what_is_beyond_training_is_told(qtbot: QtBot, played: Controller) -> None:
    notes: list[str] = []
    bar = played.window.instrument.bar
    show, bar.show_note = bar.show_note, lambda text: (notes.append(text), show(text))  # type: ignore[method-assign]
    played.patches.change("knobs.stiffness", 10.0)
    played.patches.change("knobs.gauge", 3.0)
    played.window.instrument.pressed.emit(80, 100)
    qtbot.waitUntil(lambda: bool(notes) and "outside the trained" in notes[-1], timeout=5_000)
    played.patches.change("knobs.stiffness", 1.0)  # while it rings
    played.patches.change("knobs.gauge", 1.0)
    qtbot.waitUntil(lambda: notes[-1] == "", timeout=5_000)
    played.patches.change("knobs.tension", 0.1)
    qtbot.waitUntil(lambda: "outside the trained" in notes[-1], timeout=5_000)


def test_knobs_tell_the_string_that_was_struck_last_and_take_figures(qtbot: QtBot, played: Controller) -> None:
    knobs = played.window.instrument.knobs
    tension, length = knobs.knobs["knobs.tension"], knobs.knobs["knobs.length"]
    patch = played.session.choices.patch
    assert patch is not None
    middle = sum(patch.range) // 2
    assert knobs.facts.accessibleDescription().startswith(f"key {note_name(middle)}, ")
    played.window.instrument.pressed.emit(50, 100)
    qtbot.waitUntil(lambda: knobs.facts.accessibleDescription().startswith("key D3, pitch 146.8 Hz"), timeout=5_000)
    long_mm = float(length.accessibleDescription().split()[0])
    knobs.figure_asked.emit("knobs.tension", 200.0)
    assert tension.accessibleDescription().startswith("200 N (× ")
    turned = played.session.choices.patch
    assert turned is not None
    now_mm = float(length.accessibleDescription().split()[0])
    assert now_mm == pytest.approx(long_mm * turned.knobs.tension**0.5, rel=0.01)
    knobs.figure_asked.emit("knobs.tension", 1e9)
    changed = played.session.choices.patch
    assert changed is not None
    assert changed.knobs.tension == pytest.approx(16.0)


def test_the_pluck_of_a_patch_is_given_a_shape(played: Controller) -> None:
    knobs = played.window.instrument.knobs
    assert knobs.shape.currentText() == "Triangle"
    assert not knobs.knobs["pluck.width_hard"].isEnabled()
    for shape, named in (("gaussian", "Gaussian"), ("raised_cosine", "Raised cosine")):
        knobs.changed.emit("pluck.shape", shape)
        patch = played.session.choices.patch
        assert patch is not None
        assert (patch.pluck.shape, knobs.shape.currentText()) == (shape, named)
        assert knobs.knobs["pluck.width_hard"].isEnabled()
        assert played.history.undo_words == "pluck shape"
    played.window.instrument.pressed.emit(60, 100)
    player = played.performance.live._player
    assert player is not None
    assert [each.pluck.shape for each in player.sounding()] == ["raised_cosine"]


def test_transposition_is_turned_by_whole_keys(played: Controller) -> None:
    played.window.instrument.knobs.knobs["tuning.transpose"].value_asked.emit(2.2)
    patch = played.session.choices.patch
    assert patch is not None
    assert patch.tuning.transpose == 2


def heard(played: Controller) -> Patch:
    """What keys play."""
    player = played.performance.live._player
    assert player is not None
    return player.patch


def test_the_saved_patch_is_heard_while_it_is_compared(qtbot: QtBot, played: Controller) -> None:
    saved, button = played.session.choices.patch, played.window.instrument.bar.compare
    assert saved is not None
    assert not button.isEnabled()
    played.patches.change("knobs.stiffness", 4.0)
    mine = played.session.choices.patch
    assert mine is not None
    button.click()
    assert (button.isChecked(), heard(played), played.session.choices.patch) == (True, saved, mine)
    assert played.history.undo_words == "stiffness"
    button.click()
    assert (button.isChecked(), heard(played)) == (False, mine)
    button.click()
    played.patches.change("knobs.decay", 2.0)  # of what is chosen, not of what is heard
    changed = played.session.choices.patch
    assert changed is not None
    assert (changed.knobs.stiffness, changed.knobs.decay) == (4.0, 2.0)
    assert (button.isChecked(), heard(played)) == (False, changed)
    button.click()
    played.history.undo()
    assert (button.isChecked(), heard(played)) == (False, mine)
    button.click()
    played.patches.revert()
    assert (button.isChecked(), button.isEnabled(), heard(played)) == (False, False, saved)


def test_a_patch_that_is_saved_while_it_is_compared_is_heard(
    played: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(QInputDialog, "getText", lambda *args, **words: ("Mine", True))
    played.patches.save()
    played.patches.change("knobs.stiffness", 4.0)
    mine, button = played.session.choices.patch, played.window.instrument.bar.compare
    button.click()
    played.patches.save()  # over the one that is heard
    assert (button.isChecked(), button.isEnabled(), heard(played)) == (False, False, mine)


def test_the_pick_ups_knob_moves_where_the_string_is_heard(played: Controller) -> None:
    before = played.session.choices
    played.window.instrument.knobs.changed.emit("pickup.points.0", 0.11)
    choices = played.session.choices
    assert choices.patch is not None
    assert (choices.patch.pickup.points[0], choices.listen) == (0.11, 0.11)
    played.window.instrument.pressed.emit(60, 100)
    player = played.performance.live._player
    assert player is not None
    assert [each.ear.points[0] for each in player.sounding()] == [0.11]
    played.history.undo()
    assert (played.session.choices.patch, played.session.choices.listen) == (before.patch, before.listen)


def test_the_difference_is_heard_without_body_and_room(
    qtbot: QtBot, played: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    dry: list[bool] = []
    monkeypatch.setattr(played.performance.live, "hear_dry", dry.append)
    played.session.update(b="difference", heard="b")
    played.performance.hear_dry(True)
    played.performance.hear_dry(False)  # a listening test has ended
    played.session.update(heard="a")
    assert dry == [True, True, True, False]
