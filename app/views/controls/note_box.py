"""A spin box for a key, shown as a note (E2, F♯3). It is typed also as F#3, Gb3 or a MIDI number."""

from __future__ import annotations

import re

from PySide6.QtGui import QValidator

from app.shared.key_names import key_named, note_name
from app.views.controls.number_box import CountBox, prepared

_BEGUN = re.compile(r"([A-Ga-g][#♯b♭]?-?\d?|\d{0,3})", re.ASCII)


class NoteBox(CountBox):
    """A number box whose value is the MIDI number of the key."""

    def __init__(self, name: str, tip: str) -> None:
        super().__init__()
        prepared(self, name, tip, 64)

    def understood(self, text: str) -> float | None:
        key = key_named(text)
        return key if key is not None and self.minimum() <= key <= self.maximum() else None

    def textFromValue(self, value: float) -> str:
        return note_name(int(value))

    def validate(self, text: str, position: int) -> tuple[QValidator.State, str, int]:
        if not _BEGUN.fullmatch(text.strip()):
            return QValidator.State.Invalid, text, position
        return super().validate(text, position)
