"""Drums in the window: chosen, struck by keys, pads and at places, lit, heard, recorded and exported."""

from __future__ import annotations

import shutil
from pathlib import Path

import mido
import numpy as np
import pytest
import soundfile
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from app.export.choices import ExportChoices
from app.instrument.events import NoteOff, NoteOn, TimedEvent
from app.instrument.midi_file import midi_bytes
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from app.playing.key_note import KeyNote
from app.window.controller import DRUMS_PLAYED, Controller
from tests.app.instrument.seen import seen

PADS = range(36, 52)
DRUMS = sorted(path.stem for path in PATCHES.glob("*.json") if read_patch(path).strings.kind == "drums")


def ready(qtbot: QtBot, controller: Controller) -> None:
    """Until keys play what is chosen."""

    def plays() -> bool:
        player = controller.performance.notes.keys.player
        return player is not None and player.patch == controller.session.choices.patch

    qtbot.waitUntil(plays)


def heard_db(controller: Controller) -> float:
    return controller.window.transport.meter._peak_db


def reported(controller: Controller) -> list[str]:
    """Notices, without the one that there is no device here."""
    return [each.message for each in controller.window.notices.notices if "No sound output" not in each.message]


@pytest.fixture
def kit(qtbot: QtBot, played: Controller) -> Controller:
    played.patches.choose("concert_toms")
    ready(qtbot, played)
    return played


def test_the_browser_lists_all_shipped_drums(played: Controller) -> None:
    assert len(DRUMS) == 7
    assert set(DRUMS) <= {entry.path.stem for entry in played.patches._entries}


def test_pads_sound_light_and_ring(qtbot: QtBot, kit: Controller) -> None:
    assert kit.session.choices.drums is not None
    for key in (38, 45):
        kit.window.instrument.pressed.emit(key, 110, None)
        kit.window.instrument.released.emit(key, None)
    qtbot.waitUntil(lambda: {38, 45} <= kit.performance.notes.keys.sounding().keys())
    qtbot.waitUntil(lambda: heard_db(kit) > -40)
    qtbot.waitUntil(lambda: kit.window.instrument.keys.level(45) > 0.1)
    assert kit.instruments.drum_key == 45
    assert kit.performance.notes.ringing == 2
    kit.window.instrument.pressed.emit(60, 110, None)  # no pad
    assert kit.performance.notes.ringing == 2
    kit.play_or_stop()
    qtbot.waitUntil(lambda: not kit.performance.notes.keys.sounding())
    assert reported(kit) == []


def test_pads_of_a_midi_input_strike_by_channel_ten(qtbot: QtBot, kit: Controller) -> None:
    for key in PADS:
        kit.instruments.midi._receive(NoteOn(key, 90, 9))
    struck = kit.performance.notes._notes
    assert [isinstance(note, KeyNote) and note.event.key for note in struck] == list(PADS)
    qtbot.waitUntil(lambda: all(note.known and not note.cut for note in struck))  # they may have rung out by then
    note = kit.instruments.latest
    assert isinstance(note, KeyNote)
    assert (note.event.key, note.of_drum, note.request) == (51, True, None)


def test_model_and_truth_are_switched_while_a_drum_rings(qtbot: QtBot, kit: Controller) -> None:
    kit.session.update(a="model", b="truth")
    kit.window.instrument.pressed.emit(36, 127, None)
    player = kit.performance.notes.keys.player
    assert player is not None
    qtbot.waitUntil(lambda: bool(seen(player)))
    kit.session.update(heard="b")
    assert [player.compiled.source_gain(source) for source in (0, 1)] == [0.0, 1.0]
    kit.session.update(b="difference")
    assert player.compiled.source_gain(0) == -player.compiled.source_gain(1) > 0


def test_views_of_a_string_say_that_drums_are_played(qtbot: QtBot, kit: Controller) -> None:
    """And show strings again when one is chosen."""
    assert [panel.covered for panel in kit.panels if panel.of_strings] == [
        DRUMS_PLAYED for panel in kit.panels if panel.of_strings
    ]
    assert not kit.performance.ready, "no string is plucked"
    for panel in kit.panels:  # none of them breaks while it is open
        if panel is not kit.panels[0]:
            side = "left_view" if panel.on_the_left else "right_view"
            kit.session.update(face="lab", **{side: panel.key})
            kit._tick()
            kit._show_deck()
    kit.session.update(loop=True, solo=3, pickup="bridge", listen=0.7, volume_db=-3.0)
    kit.window.instrument.pressed.emit(40, 90, None)
    qtbot.waitUntil(lambda: 40 in kit.performance.notes.keys.sounding())
    kit._tick()
    kit.patches.choose("steel_string_acoustic")
    assert all(not panel.covered for panel in kit.panels)
    qtbot.waitUntil(lambda: kit.performance.ready)
    assert reported(kit) == []


def test_the_motion_of_a_string_returns_after_a_drum_that_was_not_struck(qtbot: QtBot, kit: Controller) -> None:
    """Its motion was rendered before, perhaps while the drum was already chosen."""
    for _ in range(3):
        kit.patches.choose("steel_string_acoustic")
        kit.patches.choose("concert_toms")
    kit.patches.choose("steel_string_acoustic")
    qtbot.waitUntil(lambda: kit.performance.ready and kit.performance.settled)
    kit.patches.choose("concert_toms")
    assert kit.performance.take is None
    kit.patches.choose("steel_string_acoustic")
    qtbot.waitUntil(lambda: kit.performance.ready)


def test_space_and_a_click_strike_the_drum_that_was_struck_last(qtbot: QtBot, kit: Controller) -> None:
    notes = kit.performance.notes
    kit.play_or_stop()
    qtbot.waitUntil(lambda: notes.keys.sounding().keys() == {36})
    kit.play_or_stop()
    qtbot.waitUntil(lambda: not notes.keys.sounding())
    kit.window.instrument.pressed.emit(43, 90, None)
    kit.strike(0.1, -0.2, 100.0)
    note = kit.instruments.latest
    assert isinstance(note, KeyNote)
    assert (note.event.key, note.event.velocity, note.event.place) == (43, 100, (0.1, -0.2))
    qtbot.waitUntil(lambda: note.began)


def test_the_listening_test_compares_model_and_truth_of_a_blow(qtbot: QtBot, kit: Controller) -> None:
    kit.window.instrument.pressed.emit(38, 127, None)
    kit._tick()
    kit.session.update(stereo=True, seconds=0.5)
    kit.instruments.strike(0.2, -0.1, 100)
    kit.listening_test()
    dialog = kit._abx
    assert dialog is not None
    blow = {"instrument": "Concert toms", "key": 38, "velocity": 100, "place": [0.2, -0.1]}
    assert blow.items() <= dialog._material.pluck.items()
    assert {"seconds", "instrument_sha256"} < dialog._material.pluck.keys()
    assert "amplitude_mm" not in dialog._material.pluck
    qtbot.waitUntil(lambda: dialog._stimuli is not None)
    made = dialog._stimuli
    assert made is not None
    a, b = made.samples["A"], made.samples["B"]
    assert a.shape == b.shape == (round(0.5 * made.rate_hz), 2)
    assert np.abs(a).max() > 0.01
    assert 0 < np.abs(a - b).max() < 1e-3 * np.abs(a).max()
    kit.window.instrument.pressed.emit(40, 100, None)  # nothing else plays meanwhile
    assert 40 not in kit.performance.notes.keys.sounding()
    dialog.abandon()


def test_keys_of_the_computer_play_bars_in_pitch(qtbot: QtBot, played: Controller) -> None:
    played.patches.choose("thin_bars")
    ready(qtbot, played)
    qtbot.keyPress(played.window, Qt.Key.Key_K)
    qtbot.waitUntil(lambda: played.performance.notes.keys.sounding().keys() == {72})  # from C4 all keys sound
    qtbot.keyRelease(played.window, Qt.Key.Key_K)


def test_strings_and_drums_follow_one_another_without_a_leftover(qtbot: QtBot, kit: Controller) -> None:
    """Each needs a player of its own; what the one before has struck rings on, and stops."""
    kit.window.instrument.pressed.emit(36, 127, None)
    qtbot.waitUntil(lambda: 36 in kit.performance.notes.keys.sounding())
    kit.patches.choose("steel_string_acoustic")
    ready(qtbot, kit)
    kit.window.instrument.pressed.emit(52, 100, None)
    qtbot.waitUntil(lambda: kit.performance.notes.keys.sounding().keys() == {52})
    kit.performance.stop()
    qtbot.waitUntil(lambda: kit.sound.mixer.active == 0)
    kit.patches.choose("thin_bars")
    ready(qtbot, kit)
    key = kit.instruments.drum_key
    assert key is not None
    kit.window.instrument.pressed.emit(key, 100, None)
    qtbot.waitUntil(lambda: key in kit.performance.notes.keys.sounding())


def test_a_patch_of_drums_that_is_dropped_is_played(qtbot: QtBot, played: Controller, tmp_path: Path) -> None:
    mine = Path(shutil.copy(PATCHES / "soft_plate.json", tmp_path / "mine.json"))
    played.take_file(mine)
    ready(qtbot, played)
    assert played.session.choices.drums is not None
    played.pluck()
    qtbot.waitUntil(lambda: bool(played.performance.notes.keys.sounding()))


def test_drums_of_a_midi_file_are_played(qtbot: QtBot, kit: Controller, tmp_path: Path) -> None:
    song = tmp_path / "song.mid"
    song.write_bytes(midi_bytes([TimedEvent(0.0, NoteOn(40, 90, 9)), TimedEvent(30.0, NoteOff(40, 9))]))
    kit.take_file(song)

    def is_struck() -> bool:
        note = kit.instruments.latest
        return isinstance(note, KeyNote) and note.event.key == 40 and note.known and not note.cut

    qtbot.waitUntil(is_struck)


def test_what_is_drummed_is_recorded_and_exported(qtbot: QtBot, kit: Controller, tmp_path: Path) -> None:
    kit.exports._choices = ExportChoices(folder=str(tmp_path)), kit.exports.choices[1]
    kit.patches.recordings.record()
    for key in (36, 38, 41):
        kit.window.instrument.pressed.emit(key, 110, None)
        kit.window.instrument.released.emit(key, None)
    kit.patches.recordings.record()
    played = kit.patches.recordings.latest
    assert played is not None
    kit.exports.open("performance")
    dialog = kit.exports.dialog
    assert dialog is not None
    dialog.save.click()
    qtbot.waitUntil(lambda: "Saved" in dialog.state.text())
    sound, rate_hz = soundfile.read(next(iter(tmp_path.rglob("*.wav"))))
    assert np.abs(sound[: rate_hz // 2]).max() > 0.01
    midi = mido.MidiFile(next(iter(tmp_path.rglob("*.mid"))))
    assert {message.note for message in midi if message.type == "note_on" and message.velocity} == {36, 38, 41}


def test_a_blow_is_exported_as_a_note(qtbot: QtBot, kit: Controller, tmp_path: Path) -> None:
    """Of the drum that was struck last, as hard; dropped on the window, it chooses the instrument."""
    kit.exports._choices = ExportChoices(folder=str(tmp_path)), kit.exports.choices[1]
    kit.window.instrument.pressed.emit(38, 120, None)
    kit.exports.open("note")
    dialog = kit.exports.dialog
    assert dialog is not None
    assert "Concert toms, D2 at velocity 120" in dialog.note.what.text()
    assert not dialog.note.through.isVisible(), "there is no string"
    assert dialog.note.through_words.text() == "Concert toms with room and level, as it is heard"
    dialog.save.click()
    qtbot.waitUntil(lambda: "Saved" in dialog.state.text())
    file = tmp_path / "Concert toms D2 hard.wav"
    assert np.abs(soundfile.read(file)[0]).max() > 0.05
    kit.patches.choose("steel_string_acoustic")
    kit.take_file(file)
    assert kit.session.choices.drums is not None


def test_drums_are_exported_as_a_plug_in_too(kit: Controller) -> None:
    kit.exports.open("plugin")
    dialog = kit.exports.dialog
    assert dialog is not None
    assert dialog.kind == "plugin"
    assert dialog.plugin.job().patch.strings.kind == "drums"


def test_knobs_say_which_drum_is_meant_and_which_of_them_do_nothing(kit: Controller) -> None:
    knobs = kit.window.instrument.knobs
    assert knobs.facts._facts["drum"] == "Bass drum 22 inch"
    assert not knobs.knobs["knobs.gauge"].isEnabled()
    assert knobs.knobs["knobs.decay"].isEnabled()


def test_buttons_name_what_is_played(kit: Controller) -> None:
    bar, panel = kit.window.transport, kit.window.instrument
    assert (bar._play.text(), bar._play.accessibleName()) == ("▶  Strike", "Strike or stop")
    assert panel._fold.text() == "Drum knobs"
    kit.patches.choose("steel_string_acoustic")
    assert (bar._play.text(), panel._fold.text()) == ("▶  Pluck", "String knobs")


def test_the_surface_of_strings_shows_the_keys_of_drums(kit: Controller) -> None:
    panel = kit.window.instrument
    panel.show_surface("neck")
    assert (panel.surface, panel._stack.currentWidget()) == ("neck", panel.keys)
    kit.patches.choose("steel_string_acoustic")
    assert panel._stack.currentWidget() is panel.neck
