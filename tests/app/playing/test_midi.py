"""What MIDI messages mean, without a port or a window."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from app.instrument.events import Controller, NoteOff, NoteOn
from app.playing.keyboard import Reach
from app.playing.midi import (
    HIGHEST_NOTE,
    LOWEST_NOTE,
    TURNED,
    Meaning,
    MidiChoices,
    meaning_of,
)
from app.session.choices import Choices
from app.shared.parameters import OF_CHOICES

REACH = Reach((0.3, 0.7), (1.0, 10.0))
PRESETS = ["a", "b", "c"]


def test_notes_go_along_the_string_and_velocity_is_amplitude() -> None:
    low = meaning_of(NoteOn(LOWEST_NOTE, 1), MidiChoices(), REACH, PRESETS)
    high = meaning_of(NoteOn(HIGHEST_NOTE, 127), MidiChoices(), REACH, PRESETS)
    beyond = meaning_of(NoteOn(127, 127), MidiChoices(), REACH, PRESETS)
    assert low == Meaning({"position": pytest.approx(0.3), "amplitude_mm": pytest.approx(1)}, True)
    assert high == Meaning({"position": pytest.approx(0.7), "amplitude_mm": pytest.approx(10)}, True)
    assert beyond == high


def test_notes_choose_presets_where_the_user_wants_that() -> None:
    choices = MidiChoices(notes="preset")
    chosen = [meaning_of(NoteOn(LOWEST_NOTE + n, 64), choices, REACH, PRESETS).changes["preset"] for n in (0, 2, 3)]
    assert chosen == ["a", "c", "a"]
    assert "position" not in meaning_of(NoteOn(60, 64), choices, REACH, PRESETS).changes
    assert meaning_of(NoteOn(60, 64), choices, REACH, []).plucks


def test_a_taught_controller_goes_through_all_of_its_field() -> None:
    choices = MidiChoices()
    for number, field in enumerate(TURNED, 16):
        choices = choices.learned(field, number)
    for number, field in enumerate(TURNED, 16):
        for value, expected in zip((0, 127), OF_CHOICES[field].limits, strict=True):
            meaning = meaning_of(Controller(number, value), choices, REACH, PRESETS)
            assert meaning == Meaning({field: pytest.approx(expected)})
            Choices(**meaning.changes)  # allowed to the last bit
    assert OF_CHOICES["speed"].value(64 / 127) == pytest.approx(0.001**0.5, rel=0.05)


def test_learn_and_forget() -> None:
    choices = MidiChoices().learned("width", 74).learned("listen", 1)
    assert choices.controllers == {"width": 74, "listen": 1}
    assert choices.learned("listen", 74).controllers == {"listen": 74}  # one controller turns one thing
    assert choices.forgotten("width").controllers == {"listen": 1}
    assert meaning_of(Controller(74, 3), choices.forgotten("width"), REACH, PRESETS) == Meaning({})
    for field, number in (("colour", 1), ("width", 128)):
        with pytest.raises(ValidationError):
            choices.learned(field, number)


def test_a_release_asks_nothing_of_the_one_string() -> None:
    assert meaning_of(NoteOff(60), MidiChoices(), REACH, PRESETS) == Meaning({})
