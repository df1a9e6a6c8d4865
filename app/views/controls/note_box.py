"""A spin box for a key, shown as a note (E2, F♯3); typed also as F#3, Gb3 or a MIDI number."""

from __future__ import annotations

import re

from PySide6.QtGui import QValidator
from PySide6.QtWidgets import QSpinBox

from app.shared.key_names import key_named, note_name

_BEGUN = re.compile(r"([A-Ga-g][#♯b♭]?-?\d?|\d{0,3})", re.ASCII)


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
