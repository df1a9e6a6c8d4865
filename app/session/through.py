"""The instrument that keys sound through in the Lab, in words; there is none where a string sounds alone."""

from __future__ import annotations

from app.instrument.effects import added_words
from app.session.choices import Choices
from app.session.slots import other_preset
from app.shared.vocabulary import DIFFERENCE


def through_words(choices: Choices) -> tuple[str, ...]:
    """The instrument that keys sound through, in words, the longest wording first.

    A string that sounds alone has one empty text.
    """
    patch = choices.instrument
    if patch is None:
        return ("",)
    name = f"heard through {patch.name}"
    if any(other_preset(voice) for voice in choices.voices):
        return f"keys are {name}, a string plucked by hand alone", f"keys {name}"
    if choices.source_heard == DIFFERENCE:
        return f"{name} without amplifier, body and room", name
    return f"{name}: {added_words(patch)}", name
