"""Events one after the other: each plays what those before it have chosen."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from app.instrument.events import NoteOn, PluckAt
from app.instrument.strings import Strings
from app.patches.instrument import SingleString
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from app.playing.key_note import KeyNote
from app.playing.keyboard import HIGHEST_PLACE, LOWEST_PLACE, PLACES
from app.rendering.subject import path_of, string_of
from app.window.controller import Controller
from engine.pluck import Pluck
from engine.presets.finding import SHIPPED
from tests.app.window.shown import key_is_shown


@pytest.mark.parametrize("known", [True, False], ids=["window knows the key", "window is busy"])
def test_midi_selects_a_preset_of_one_string_after_a_key_of_a_patch(
    qtbot: QtBot, played: Controller, known: bool
) -> None:
    session, midi = played.session, played.instruments.midi
    played.window.instrument.pressed.emit(52, 100, None)
    if known:
        qtbot.waitUntil(lambda: key_is_shown(played))
    midi._remember(midi.choices.model_copy(update={"notes": "preset"}))
    midi._receive(NoteOn(LOWEST_PLACE + played.library.names.index("second"), 100))  # as in mido's thread
    note = played.performance.notes._notes[-1]
    assert path_of(note.request.preset).stem == "second"
    assert string_of(note.request.preset) is None, "the string of the instrument's key"
    qtbot.waitUntil(lambda: note.seconds > 0 or note.cut)
    assert not note.cut
    qtbot.waitUntil(lambda: session.choices.preset == "second")
    assert session.choices.string is None
    assert "cannot" not in played.window.notices.text


@pytest.mark.parametrize("known", [True, False], ids=["window knows the preset", "window is busy"])
def test_a_pluck_after_a_preset_that_midi_has_selected_is_of_that_preset(
    qtbot: QtBot, played: Controller, known: bool
) -> None:
    session, instruments = played.session, played.instruments
    instruments._play_note(NoteOn(LOWEST_PLACE + played.library.names.index("second"), 100), "preset")
    if known:
        qtbot.waitUntil(lambda: session.choices.preset == "second")
    session.update(volume_db=-3.0)  # another choice takes nothing back
    instruments.play(PluckAt(Pluck(0.6, 2.5)))
    note = played.performance.notes._notes[-1]
    assert path_of(note.request.preset).stem == "second"
    qtbot.waitUntil(lambda: session.choices.position == 0.6)
    assert (session.choices.preset, session.choices.amplitude_mm) == ("second", 2.5)
    assert session.choices.instrument == SingleString(preset="second")


def test_a_note_of_midi_sets_the_place_where_the_string_is_plucked(qtbot: QtBot, played: Controller) -> None:
    """Also while a patch is the instrument: on the string of the key that was struck last."""
    session, reach = played.session, played.instruments.reach
    played.window.instrument.pressed.emit(52, 100, None)
    qtbot.waitUntil(lambda: key_is_shown(played))
    string = session.choices.string
    midi = played.instruments.midi
    midi._remember(midi.choices.model_copy(update={"notes": "position"}))
    midi._receive(NoteOn(HIGHEST_PLACE, 127))
    qtbot.waitUntil(lambda: session.choices.position == reach.position[1])
    assert session.choices.amplitude_mm == reach.amplitude_mm[1]
    assert (session.choices.string, session.choices.plays_patch) == (string, True)


def test_places_are_prepared_where_keys_choose_them_alone(
    qtbot: QtBot, played: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepared: list[list[float]] = []
    monkeypatch.setattr(
        played.performance.notes,
        "prepare_plucks",
        lambda subject, plucks: prepared.append([pluck.position for pluck in plucks]),
    )
    for key in (52, 55):
        played.window.instrument.pressed.emit(key, 100, None)
        qtbot.waitUntil(lambda key=key: played.instruments.latest_key == (key, None))  # type: ignore[misc]
    qtbot.waitUntil(lambda: not played.instruments._reported and key_is_shown(played))
    assert prepared == []
    played.session.play_string()
    (positions,) = prepared
    assert len(set(positions)) == PLACES
    played.session.update(amplitude_mm=3.3)
    assert len(prepared) == 2


def test_a_pluck_by_hand_plays_the_string_that_was_restored(qtbot: QtBot, played: Controller) -> None:
    """As at a start, or after undo: no key has been struck, or one of another instrument."""
    patch = read_patch(PATCHES / "concert_harp.json")
    string = Strings(patch).of_key(43)
    assert string is not None
    shown = string.parameters
    played.session.update(instrument=patch, string=shown, shape=patch.pluck.shape)
    qtbot.waitUntil(lambda: played.performance.playable)
    played.pluck()
    note = played.instruments.latest
    assert isinstance(note, KeyNote) and note.event.key == 43
    qtbot.waitUntil(lambda: note.request is not None)
    assert played.session.choices.string == shown


def test_undo_of_an_instrument_with_another_preset_shows_its_pluck_again(
    qtbot: QtBot, played: Controller, preset_folder: Path
) -> None:
    shutil.copy(SHIPPED / "studio_any_string.safetensors", preset_folder / "another.safetensors")
    played.library.refresh()
    guitar = read_patch(PATCHES / "classical_guitar.json")
    other = read_patch(PATCHES / "cimbalom.json").model_copy(update={"preset": "another"})
    assert guitar.pluck.shape != other.pluck.shape
    session, instruments = played.session, played.instruments
    session.update(instrument=guitar)
    qtbot.waitUntil(lambda: not instruments._own_timer.isActive())
    string, shape = session.choices.string, session.choices.shape
    assert string is not None and shape == guitar.pluck.shape
    session.update(instrument=other)
    qtbot.waitUntil(lambda: session.choices.shape == other.pluck.shape)
    played.history.undo()
    qtbot.waitUntil(lambda: not instruments._own_timer.isActive())
    assert (session.choices.string, session.choices.shape) == (string, shape)


def test_an_export_of_a_pluck_by_hand_has_the_pluck_that_is_shown(qtbot: QtBot, played: Controller) -> None:
    session, instruments = played.session, played.instruments
    qtbot.waitUntil(lambda: session.choices.string is not None and played.performance.playable)
    played.pluck()
    assert instruments.struck is not None and instruments.struck.event.pluck == session.choices.pluck
    session.update(position=0.41)
    assert instruments.struck.event.pluck == session.choices.pluck
    session.update(b="preset:second")
    assert instruments.struck is None, "another preset plays the string alone"
