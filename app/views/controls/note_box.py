"""A spin box for a key, shown as a note (E2, F♯3); typed also as F#3, Gb3 or a MIDI number."""

from __future__ import annotations

import re

from PySide6.QtGui import QValidator
from PySide6.QtWidgets import QSpinBox

from app.views.instrument.playable import note_name

_SEMITONES = {"C": 0, "D": 2, "E": 4, "F": 5, "G": 7, "A": 9, "B": 11}
_SIGNS = {"": 0, "#": 1, "♯": 1, "b": -1, "♭": -1}
_NOTE = re.compile(r"([A-Ga-g])([#♯b♭]?)(-?\d)", re.ASCII)
_BEGUN = re.compile(r"([A-Ga-g][#♯b♭]?-?\d?|\d{0,3})", re.ASCII)


def key_named(text: str) -> int | None:
    """The MIDI key of a note's name or number; None where it is none. C4 is 60, as in `note_name`."""
    text = text.strip()
    if text.isdecimal() and text.isascii():
        return int(text)
    found = _NOTE.fullmatch(text)
    if found is None:
        return None
    letter, sign, octave = found.groups()
    return _SEMITONES[letter.upper()] + _SIGNS[sign] + 12 * (int(octave) + 1)


class NoteBox(QSpinBox):
    """Its value is the MIDI number of the key."""

    def __init__(self, name: str, tip: str) -> None:
        super().__init__()
        self.setAccessibleName(name)
        self.setToolTip(tip)
        self.setMinimumWidth(64)
        self.setKeyboardTracking(False)  # a note that is half typed is another one
        self.lineEdit().setTextMargins(6, 0, 0, 0)

    def textFromValue(self, value: int) -> str:
        return note_name(value)

    def valueFromText(self, text: str) -> int:
        key = key_named(text)
        return self.value() if key is None else key

    def validate(self, text: str, position: int) -> tuple[QValidator.State, str, int]:
        key = key_named(text)
        if key is not None and self.minimum() <= key <= self.maximum():
            state = QValidator.State.Acceptable
        elif _BEGUN.fullmatch(text.strip()):
            state = QValidator.State.Intermediate
        else:
            state = QValidator.State.Invalid
        return state, text, position
