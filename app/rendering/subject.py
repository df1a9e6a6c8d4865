"""What is plucked: a preset as it is, or a preset of many strings as one of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from engine.presets import Preset, load_preset
from engine.presets.of_string import of_string
from engine.resonators.string import StringParameters


@dataclass(frozen=True)
class StringOf:
    """A preset of many strings, as this one."""

    path: Path
    string: StringParameters


Subject = Path | StringOf


def load_subject(subject: Subject) -> Preset:
    """Raises PresetError: the file cannot be used, or its model cannot be this string."""
    if isinstance(subject, StringOf):
        return of_string(load_preset(subject.path), subject.string)
    return load_preset(subject)


def path_of(subject: Subject) -> Path:
    """Of the preset."""
    return subject.path if isinstance(subject, StringOf) else subject


def string_of(subject: Subject) -> StringParameters | None:
    """None: the preset's own."""
    return subject.string if isinstance(subject, StringOf) else None
