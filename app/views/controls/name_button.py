"""A button that shows a name and opens a list of others."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QPushButton, QSizePolicy

PADDING = 26  # of the style sheet, with the borders


class NameButton(QPushButton):
    """Cut in the middle where there is little room: presets of one string differ at their ends."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.setObjectName("preset")
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setText(text)

    def setText(self, text: str) -> None:
        self._full_text = text
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        cut, room = Qt.TextElideMode.ElideMiddle, self.width() - PADDING
        super().setText(self.fontMetrics().elidedText(self._full_text, cut, room, Qt.TextFlag.TextShowMnemonic))
