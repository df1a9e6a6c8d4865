"""Names of MIDI keys; C4 is 60."""

from __future__ import annotations

import re

NAMES = ("C", "C♯", "D", "D♯", "E", "F", "F♯", "G", "G♯", "A", "A♯", "B")
_SIGNS = {"": 0, "#": 1, "♯": 1, "b": -1, "♭": -1}
_NOTE = re.compile(r"([A-Ga-g])([#♯b♭]?)(-?\d)", re.ASCII)
_NUMBER = re.compile(r"\d{1,3}", re.ASCII)


def note_name(key: int) -> str:
    """The note of a MIDI key, with its octave, such as F♯3."""
    return f"{NAMES[key % 12]}{key // 12 - 1}"


def key_named(text: str) -> int | None:
    """The MIDI key of a note's name, such as F♯3, F#3 or Gb3, or of a number. None where `text` is neither."""
    text = text.strip()
    if _NUMBER.fullmatch(text):
        return int(text)
    match = _NOTE.fullmatch(text)
    if match is None:
        return None
    letter, sign, octave = match.groups()
    return NAMES.index(letter.upper()) + _SIGNS[sign] + 12 * (int(octave) + 1)
