"""Fields for numbers, typed and shown as on knobs: a point in every locale, read by `app.shared.typed_number`.

Typed text counts when it is whole: at Enter, or as the focus leaves. A refused one leaves the value, and says so.
"""

from __future__ import annotations

import re

from PySide6.QtCore import QPoint, QRect
from PySide6.QtGui import QKeyEvent, QValidator
from PySide6.QtWidgets import QDoubleSpinBox, QToolTip, QWidget

from app.shared.key_names import key_named, note_name
from app.shared.typed_number import typed_number
from app.views.controls.parts import ENTER_KEYS
from app.views.controls.plain import plain_tip

TIP_ABOVE = 44  # pixels over a widget, out of the way of the hand
_NOTE_BEGUN = re.compile(r"([A-Ga-g][#♯b♭]?-?\d?|\d{0,3})", re.ASCII)


def say_above(widget: QWidget, words: str, shown_ms: int = -1) -> None:
    """Show words above a widget as plain text, for a while, or for a time in ms."""
    QToolTip.showText(widget.mapToGlobal(QPoint(0, -TIP_ABOVE)), plain_tip(words), widget, QRect(), shown_ms)


def refusal(text: str, example: str) -> str:
    """The reason why a typed text changed nothing; the example is the value that is kept, as it is shown."""
    return f"“{text.strip()[:30]}” is no number here, as {example} is, which is kept"


class NumberBox(QDoubleSpinBox):
    """A field for a number with its unit. Typed text counts at Enter, or as the focus leaves, if it is understood.

    Args:
        limits: lowest and highest value.
        suffix, prefix: text behind and before the number, such as its unit.
        width: least width in pixels.
    """

    def __init__(
        self,
        name: str,
        limits: tuple[float, float],
        value: float,
        tip: str,
        suffix: str = "",
        decimals: int = 0,
        step: float = 1,
        prefix: str = "",
        width: int = 84,
    ) -> None:
        low, high = limits
        super().__init__(
            minimum=low, maximum=high, singleStep=step, suffix=suffix, prefix=prefix, decimals=decimals, value=value
        )
        self.setAccessibleName(name)
        self.setToolTip(tip)
        self.setMinimumWidth(width)
        self.setKeyboardTracking(False)
        self.lineEdit().setTextMargins(6, 0, 0, 0)

    def understood(self, text: str) -> float | None:
        """The value that a text of the field means, within its range; None: none."""
        if self.specialValueText() and self._own(text) in ("", self.specialValueText()):
            return float(self.minimum())
        number = typed_number(self._own(text), self.suffix(), self.prefix())
        if number is None or (self.decimals() == 0 and not number.is_integer()):
            return None
        return number if self.minimum() <= number <= self.maximum() else None

    def _own(self, text: str) -> str:
        """The text between prefix and suffix of the field; a typed unit is in it."""
        return text.removeprefix(self.prefix()).removesuffix(self.suffix()).strip()

    def textFromValue(self, value: float) -> str:
        return f"{value:.{self.decimals()}f}"

    def valueFromText(self, text: str) -> float:
        number = self.understood(text)
        return self.value() if number is None else number

    def validate(self, text: str, position: int) -> tuple[QValidator.State, str, int]:
        state = QValidator.State
        return (state.Intermediate if self.understood(text) is None else state.Acceptable), text, position

    def fixup(self, text: str) -> str:
        """Show above the field why a typed text is refused, and which value is kept; Qt then shows that again."""
        valid_text = self.specialValueText() if self.value() == self.minimum() else ""
        valid_text = valid_text or f"{self.prefix()}{self.textFromValue(self.value())}{self.suffix()}"
        number = typed_number(self._own(text), self.suffix(), self.prefix())
        words = refusal(text, valid_text)
        if number is not None and not self.minimum() <= number <= self.maximum():
            low, high = self.textFromValue(self.minimum()), self.textFromValue(self.maximum())
            words = f"Only {low} … {high}{self.suffix()}: {valid_text} is kept"
        say_above(self, words)
        return text

    def keyPressEvent(self, event: QKeyEvent) -> None:
        refused = event.key() in ENTER_KEYS and self.understood(self.text()) is None
        super().keyPressEvent(event)
        if refused:
            event.accept()  # or it would press the dialog's button


class CountBox(NumberBox):
    """A field for a whole number."""

    def __init__(self, name: str, most: int, value: int, tip: str, least: int = 1, width: int = 56) -> None:
        super().__init__(name, (least, most), value, tip, width=width)

    def value(self) -> int:
        return round(super().value())


class NoteBox(CountBox):
    """A field for a key by its MIDI number, shown as a note (E2, F♯3). F#3, Gb3 or the number can be typed."""

    def __init__(self, name: str, tip: str) -> None:
        super().__init__(name, 99, 0, tip, least=0, width=64)

    def understood(self, text: str) -> float | None:
        key = key_named(text)
        return key if key is not None and self.minimum() <= key <= self.maximum() else None

    def textFromValue(self, value: float) -> str:
        return note_name(int(value))

    def validate(self, text: str, position: int) -> tuple[QValidator.State, str, int]:
        if not _NOTE_BEGUN.fullmatch(text.strip()):
            return QValidator.State.Invalid, text, position
        return super().validate(text, position)
