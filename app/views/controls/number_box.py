"""Fields for numbers, typed and shown as on knobs: a point in every locale, read by `app.shared.typed_number`.

Typed text counts when it is whole: at Enter, or as the focus leaves. A refused one leaves the value, and says so.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QPoint
from PySide6.QtGui import QKeyEvent, QValidator
from PySide6.QtWidgets import QAbstractSpinBox, QDoubleSpinBox, QSpinBox, QToolTip, QWidget

from app.shared.typed_number import typed_number
from app.views.controls.parts import ENTER_KEYS
from app.views.controls.plain import plain_tip

TIP_ABOVE = 44  # pixels over a widget, out of the way of the hand


def say_above(widget: QWidget, words: str) -> None:
    """Show words above a widget for a while, as plain text."""
    QToolTip.showText(widget.mapToGlobal(QPoint(0, -TIP_ABOVE)), plain_tip(words), widget)


def refusal(text: str, example: str) -> str:
    """The reason why a typed text changed nothing; the example is the value that is kept, as it is shown."""
    return f"“{text.strip()[:30]}” is no number here, as {example} is, which is kept"


class _Typed(QAbstractSpinBox if TYPE_CHECKING else object):  # type: ignore[misc]
    """The parts that both kinds of number boxes share, before the widget's class."""

    if TYPE_CHECKING:  # of the widget's class
        value: Callable[[], Any]
        minimum: Callable[[], Any]
        maximum: Callable[[], Any]
        prefix: Callable[[], str]
        suffix: Callable[[], str]

    def understood(self, text: str) -> float | None:
        """The value that a text of the field means, within its range; None: none."""
        if self.specialValueText() and self._own(text) in ("", self.specialValueText()):
            return float(self.minimum())
        number = self._number(text)
        if number is None or (self.digits() == 0 and not number.is_integer()):
            return None
        return number if self.minimum() <= number <= self.maximum() else None

    def _own(self, text: str) -> str:
        """The text between prefix and suffix of the field; a typed unit is in it."""
        return text.removeprefix(self.prefix()).removesuffix(self.suffix()).strip()

    def _number(self, text: str) -> float | None:
        return typed_number(self._own(text), self.suffix(), self.prefix())

    def digits(self) -> int:
        """Digits behind the point."""
        return 0

    def textFromValue(self, value: float) -> str:
        return f"{value:.{self.digits()}f}"

    def validate(self, text: str, position: int) -> tuple[QValidator.State, str, int]:
        state = QValidator.State
        return (state.Intermediate if self.understood(text) is None else state.Acceptable), text, position

    def fixup(self, text: str) -> str:
        """Say that a text is refused, as it would count; Qt then shows the value again."""
        valid_text = self.specialValueText() if self.value() == self.minimum() else ""
        valid_text = valid_text or f"{self.prefix()}{self.textFromValue(self.value())}{self.suffix()}"
        number = typed_number(
            text.removeprefix(self.prefix()).removesuffix(self.suffix()), self.suffix(), self.prefix()
        )
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


class NumberBox(_Typed, QDoubleSpinBox):
    """A field for a number with its unit."""

    def digits(self) -> int:
        return int(self.decimals())

    def valueFromText(self, text: str) -> float:
        number = self.understood(text)
        return self.value() if number is None else number


class CountBox(_Typed, QSpinBox):
    """A field for a whole number."""

    def valueFromText(self, text: str) -> int:
        number = self.understood(text)
        return self.value() if number is None else int(number)


def prepared(box: QAbstractSpinBox, name: str, tip: str, width: int) -> None:
    """Set what all of these fields have: name, tooltip, least width, and that only a whole text counts."""
    box.setAccessibleName(name)
    box.setToolTip(tip)
    box.setMinimumWidth(width)
    box.setKeyboardTracking(False)
    box.lineEdit().setTextMargins(6, 0, 0, 0)
