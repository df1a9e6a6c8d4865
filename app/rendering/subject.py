"""The subject that is plucked: a preset as it is, or a preset of many strings as a given one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from engine.presets import Preset, load_preset
from engine.presets.of_string import of_string
from engine.values.string import StringParameters


@dataclass(frozen=True)
class StringOf:
    """A preset of many strings, played as this one."""

    path: Path
    string: StringParameters


Subject = Path | StringOf


def load_subject(subject: Subject) -> Preset:
    """Load and check the preset.

    Raises:
        PresetError: the file cannot be used, or it is not of many strings, or this string is not possible.
    """
    if isinstance(subject, StringOf):
        return of_string(load_preset(subject.path), subject.string)
    return load_preset(subject)


def path_of(subject: Subject) -> Path:
    """The preset's file."""
    return subject.path if isinstance(subject, StringOf) else subject


def string_of(subject: Subject) -> StringParameters | None:
    """The string that is given; None: the preset's own."""
    return subject.string if isinstance(subject, StringOf) else None
