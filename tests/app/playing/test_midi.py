"""What MIDI messages mean, without a port or a window."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from app.instrument.events import Controller, NoteOff, NoteOn
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from app.patches.patch import Pickup
from app.playing.keyboard import Reach
from app.playing.midi import (
    HIGHEST_NOTE,
    LOWEST_NOTE,
    Meaning,
    MidiChoices,
    meaning_of,
)
from app.session.choices import Choices
from app.shared.parameters import LEARNABLE, OF_CHOICES, OF_PATCHES

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
    learned = [field for field in LEARNABLE if field in OF_CHOICES]
    for number, field in enumerate(learned, 16):
        choices = choices.learned(field, number)
    for number, field in enumerate(learned, 16):
        for value, expected in zip((0, 127), OF_CHOICES[field].limits, strict=True):
            meaning = meaning_of(Controller(number, value), choices, REACH, PRESETS)
            assert meaning == Meaning({field: pytest.approx(expected)})
            Choices(**meaning.changes)  # allowed to the last bit
    assert OF_CHOICES["speed"].value(64 / 127) == pytest.approx(0.001**0.5, rel=0.05)


@pytest.mark.parametrize("field", [field for field in LEARNABLE if field in OF_PATCHES])
def test_a_controller_turns_every_parameter_of_the_patch(field: str) -> None:
    points = Pickup(points=(0.3, 0.7))
    patch = read_patch(PATCHES / "classical_guitar.json").model_copy(update={"pickup": points})
    patch = patch.with_value("pluck.softest_mm", 0.001)  # which may not be above the hardest
    meaning = meaning_of(Controller(16, 64), MidiChoices().learned(field, 16), REACH, PRESETS, patch)
    expected = OF_PATCHES[field].value(64 / 127)
    assert meaning.changes["patch"].value(field) == pytest.approx(expected)
    assert meaning_of(Controller(16, 64), MidiChoices().learned(field, 16), REACH, PRESETS) == Meaning({})


def test_a_controller_turns_a_macro_and_leaves_what_is_impossible() -> None:
    patch = read_patch(PATCHES / "classical_guitar.json")
    macro, last = MidiChoices().learned("macros.0", 16), MidiChoices().learned("macros.7", 16)
    assert meaning_of(Controller(16, 127), macro, REACH, PRESETS, patch).changes["patch"] == patch.turned(0, 1.0)
    assert meaning_of(Controller(16, 127), last, REACH, PRESETS, patch).changes["patch"] == patch  # it has fewer
    softest = MidiChoices().learned("pluck.softest_mm", 16)  # it may not be above the hardest
    soft = patch.with_value("pluck.hardest_mm", 0.5)
    assert meaning_of(Controller(16, 127), softest, REACH, PRESETS, soft).changes["patch"] == soft


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
