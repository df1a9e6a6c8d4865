"""Labels and tooltips of plain text, for what comes from files.

By default Qt shows a text that looks like HTML as HTML, and loads the pictures that it names.
"""

from __future__ import annotations

from html import escape
from typing import Any

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import Qt as GuiQt
from PySide6.QtWidgets import QLabel


class Label(QLabel):
    """A QLabel of plain text, unless another format is asked for."""

    def __init__(self, *arguments: Any, **properties: Any) -> None:
        super().__init__(*arguments, **properties)
        if self.textFormat() == Qt.TextFormat.AutoText:
            self.setTextFormat(Qt.TextFormat.PlainText)


class SteadyLabel(Label):
    """A label with room for `widest`, so that what stands beside it stays where it is. A longer text has its room."""

    def __init__(self, widest: str) -> None:
        super().__init__(widest)
        self._widest = widest

    def sizeHint(self) -> QSize:
        hint, letters = super().sizeHint(), self.fontMetrics()
        spare = letters.horizontalAdvance(self._widest) - letters.horizontalAdvance(self.text())
        return QSize(hint.width() + max(0, spare), hint.height())

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()


def plain_tip(text: str) -> str:
    """The tooltip that shows this very text: tooltips have no text format, so what looks like markup is escaped."""
    if not GuiQt.mightBeRichText(text):
        return text
    return f"<p style='white-space: pre-wrap'>{escape(text)}</p>"
