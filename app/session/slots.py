"""The contents of the two slots of the A/B comparison, and what is known of them for the plucked string."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from pathlib import Path

from app.player.effects import added_words
from app.presets.library import Library, PresetEntry
from app.rendering.note_sound import NoteSound, Struck
from app.rendering.subject import StringOf, Subject
from app.session.choices import Choices
from app.shared.vocabulary import DIFFERENCE, OTHER
from engine.presets import PresetInfo
from engine.presets.of_string import info_of_string


def other_preset(source: str) -> str:
    """NAME of a source "preset:NAME"; "" of any other source."""
    return source.removeprefix(OTHER) if source.startswith(OTHER) else ""


def source_title(source: str, library: Library) -> str:
    """A source's name for people; of another preset its title, or its name where it is not in the library."""
    if name := other_preset(source):
        entry = library.find(name)
        return entry.title if entry else name
    return source


def info_of(choices: Choices, entry: PresetEntry) -> PresetInfo:
    """The preset's info for the string that is plucked, or for its own string where it cannot play that one."""
    if choices.string is not None and entry.info.family is not None:
        with contextlib.suppress(ValueError):
            return info_of_string(entry.info, choices.string)
    return entry.info


def missing_presets(choices: Choices, library: Library) -> dict[str, str]:
    """The names, by slot, of presets that slots hold and that are not in the library (any more)."""
    presets = {"a": other_preset(choices.a), "b": other_preset(choices.b)}
    return {slot: name for slot, name in presets.items() if name and library.find(name) is None}


def subject_of(choices: Choices, preset: Path) -> Subject:
    """The string that is shown: the preset's own, or the one that is chosen for a preset of many."""
    return preset if choices.string is None else StringOf(preset, choices.string)


def sound_of(choices: Choices, preset: Path, struck: Struck | None = None) -> NoteSound:
    """The sound of the chosen pluck, or of the key `struck`, played by a preset."""
    return NoteSound(subject_of(choices, preset), choices.pluck, choices.seconds, choices.ear, struck=struck)


def request_of(choices: Choices, library: Library) -> NoteSound | None:
    """The chosen pluck, with the other presets that slots hold.

    None where its preset is not in the library, and where drums are played: no string is plucked then.
    """
    entry = library.find(choices.preset)
    if entry is None or choices.drums is not None:
        return None
    others = [library.find(name) for name in dict.fromkeys(map(other_preset, (choices.a, choices.b)))]
    paths = tuple(other.path for other in others if other is not None)
    return replace(sound_of(choices, entry.path), speed=choices.speed, others=paths)


def through_words(choices: Choices) -> tuple[str, ...]:
    """The instrument that keys sound through, in words, the longest wording first.

    A string that sounds alone has one empty text.
    """
    instrument = choices.played
    if instrument is None:
        return ("",)
    name = f"heard through {instrument.name}"
    if any(other_preset(voice) for voice in choices.voices):
        return f"keys are {name}, a string plucked by hand alone", f"keys {name}"
    if choices.source_heard == DIFFERENCE:
        return f"{name} without amplifier, body and room", name
    return f"{name}: {added_words(instrument)}", name
