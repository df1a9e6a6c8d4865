"""The parts of a note outside the training of the model that plays it, also after a knob was turned."""

from __future__ import annotations

import contextlib

from app.instrument.events import NoteOn
from app.instrument.facts import by_two_numbers
from app.instrument.string_keys import on_string
from app.instrument.strings import Strings
from app.patches.patch import Patch
from engine.pluck import Pluck
from engine.presets import PresetInfo, outside_training
from engine.presets.of_string import info_of_string
from engine.values.string import StringParameters


def outside_of_key(info: PresetInfo, patch: Patch, event: NoteOn, string: int | None = None) -> list[str]:
    """The warnings as of `outside_of_string`, for a key's sound; empty for a key without a possible string.

    Wheels and slides are left out.

    Args:
        string: on which of a set it is played, as of `Strings.of_key`.
    """
    try:
        key_string = Strings(patch).of_key(event.key, string)
    except ValueError:
        key_string = None
    if key_string is None:
        return []
    return outside_of_string(
        info, by_two_numbers(patch, key_string.parameters), on_string(key_string, patch.pluck.pluck(event.velocity))
    )


def outside_of_string(info: PresetInfo, string: StringParameters, pluck: Pluck) -> list[str]:
    """The differences of a string and its pluck from a preset's training, in plain words; empty where none."""
    if info.family is not None:
        with contextlib.suppress(ValueError):  # it cannot play that one; its own string is judged
            info = info_of_string(info, string)
    return outside_training(info, pluck)
