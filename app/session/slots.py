"""What the two slots of the A/B comparison hold."""

from __future__ import annotations

from app.presets.library import Library
from app.session.choices import Choices
from app.shared.vocabulary import OTHER


def other_preset(source: str) -> str:
    """NAME of a source "preset:NAME"; "" of any other source."""
    return source.removeprefix(OTHER) if source.startswith(OTHER) else ""


def source_title(source: str, library: Library) -> str:
    """A source's name for people; of another preset its title, or its name where it is not in the library."""
    if name := other_preset(source):
        entry = library.find(name)
        return entry.title if entry else name
    return source


def missing_presets(choices: Choices, library: Library) -> dict[str, str]:
    """By slot, the name of the preset that it holds, for those that are not in the library (any more)."""
    held = {"a": other_preset(choices.a), "b": other_preset(choices.b)}
    return {slot: name for slot, name in held.items() if name and library.find(name) is None}
