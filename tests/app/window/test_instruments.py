"""Events one after the other: each plays what those before it have chosen."""

from __future__ import annotations

import pytest
from pytestqt.qtbot import QtBot

from app.instrument.events import NoteOn, PluckAt
from app.patches.instrument import SingleString
from app.playing.keyboard import HIGHEST_PLACE, LOWEST_PLACE, PLACES
from app.rendering.subject import path_of, string_of
from app.window.controller import Controller
from engine.pluck import Pluck
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
