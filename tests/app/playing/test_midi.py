"""What MIDI controllers turn, without a port or a window."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from app.instrument.events import Controller
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from app.patches.patch import Pickup
from app.playing.midi import MidiChoices, turns_of
from app.session.choices import Choices
from app.shared.parameters import LEARNABLE, OF_CHOICES, OF_PATCHES


def test_a_taught_controller_goes_through_all_of_its_field() -> None:
    choices = MidiChoices()
    learned = [field for field in LEARNABLE if field in OF_CHOICES]
    for number, field in enumerate(learned, 16):
        choices = choices.learned(field, number)
    for number, field in enumerate(learned, 16):
        for value, expected in zip((0, 127), OF_CHOICES[field].limits, strict=True):
            turns = turns_of(Controller(number, value), choices, None)
            assert turns == {field: pytest.approx(expected)}
            Choices(**turns)  # allowed to the last bit
    assert OF_CHOICES["speed"].value(64 / 127) == pytest.approx(0.001**0.5, rel=0.05)


@pytest.mark.parametrize("field", [field for field in LEARNABLE if field in OF_PATCHES])
def test_a_controller_turns_every_parameter_of_the_patch(field: str) -> None:
    points = Pickup(points=(0.3, 0.7))
    patch = read_patch(PATCHES / "classical_guitar.json").model_copy(update={"pickup": points})
    patch = patch.with_value("pluck.softest_mm", 0.001)  # which may not be above the hardest
    turns = turns_of(Controller(16, 64), MidiChoices().learned(field, 16), patch)
    expected = OF_PATCHES[field].value(64 / 127)
    assert turns["patch"].value(field) == pytest.approx(expected)
    assert turns_of(Controller(16, 64), MidiChoices().learned(field, 16), None) == {}


def test_a_controller_turns_a_macro_and_leaves_what_is_impossible() -> None:
    patch = read_patch(PATCHES / "classical_guitar.json")
    macro, last = MidiChoices().learned("macros.0", 16), MidiChoices().learned("macros.7", 16)
    assert turns_of(Controller(16, 127), macro, patch)["patch"] == patch.turned(0, 1.0)
    assert turns_of(Controller(16, 127), last, patch)["patch"] == patch  # it has fewer
    softest = MidiChoices().learned("pluck.softest_mm", 16)  # it may not be above the hardest
    soft = patch.with_value("pluck.hardest_mm", 0.5)
    assert turns_of(Controller(16, 127), softest, soft)["patch"] == soft


def test_learn_and_forget() -> None:
    choices = MidiChoices().learned("width", 74).learned("listen", 1)
    assert choices.controllers == {"width": 74, "listen": 1}
    assert choices.learned("listen", 74).controllers == {"listen": 74}  # one controller turns one thing
    assert choices.forgotten("width").controllers == {"listen": 1}
    assert turns_of(Controller(74, 3), choices.forgotten("width"), None) == {}
    for field, number in (("colour", 1), ("width", 128)):
        with pytest.raises(ValidationError):
            choices.learned(field, number)
