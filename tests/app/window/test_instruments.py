"""Notes of several instruments one after the other: each is struck with what the notes before it have chosen."""

from __future__ import annotations

import pytest
from pytestqt.qtbot import QtBot

from app.instrument.events import NoteOn
from app.playing.keyboard import PLACES
from app.playing.midi import LOWEST_NOTE
from app.rendering.subject import path_of, string_of
from app.window.controller import Controller


@pytest.mark.parametrize("known", [True, False], ids=["window knows the key", "window is busy"])
def test_midi_selects_a_preset_of_one_string_after_a_key_of_a_patch(
    qtbot: QtBot, played: Controller, known: bool
) -> None:
    session, midi = played.session, played.instruments.midi
    played.window.instrument.pressed.emit(52, 100)
    if known:
        qtbot.waitUntil(lambda: session.choices.string is not None)
    midi._remember(midi.choices.model_copy(update={"notes": "preset"}))
    midi._receive(NoteOn(LOWEST_NOTE + played.library.names.index("second"), 100))  # as in mido's thread
    note = played.performance.notes._notes[-1]
    assert path_of(note.stroke.preset).stem == "second"
    assert string_of(note.stroke.preset) is None, "the string of the patch's key"
    qtbot.waitUntil(lambda: note.seconds > 0 or note.cut)
    assert not note.cut
    qtbot.waitUntil(lambda: session.choices.preset == "second")
    assert session.choices.string is None
    assert "cannot" not in played.window.notices.text


def test_a_note_struck_just_before_the_session_takes_another_is_of_its_preset(
    qtbot: QtBot, played: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    session, instruments = played.session, played.instruments
    play = session.play

    def play_late(**changes: object) -> None:
        monkeypatch.setattr(session, "play", play)
        instruments.perform({"position": 0.6}, True)  # as another thread may
        play(**changes)

    monkeypatch.setattr(session, "play", play_late)
    instruments.perform({"preset": "second", "position": 0.4, "amplitude_mm": 2.5}, True)
    qtbot.waitUntil(lambda: session.choices.position == 0.6)
    assert (session.choices.preset, session.choices.amplitude_mm) == ("second", 2.5)
    note = played.performance.notes._notes[-1]
    assert path_of(note.stroke.preset).stem == "second"
    assert (note.stroke.pluck.position, note.stroke.pluck.amplitude_mm) == (0.6, 2.5)


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
        played.window.instrument.pressed.emit(key, 100)
        qtbot.waitUntil(lambda key=key: played.instruments.latest_key == (key, None))  # type: ignore[misc]
    qtbot.waitUntil(lambda: not played.instruments._told)
    assert played.session.choices.string is not None
    assert prepared == []
    played.session.update(keys_play="place")
    (positions,) = prepared
    assert len(set(positions)) == PLACES
    played.session.update(amplitude_mm=3.3)
    assert len(prepared) == 2
