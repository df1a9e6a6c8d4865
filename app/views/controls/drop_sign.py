"""A frame and words over the window while files hover over it."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from app.views.controls.plain import Label

MARGIN = 12  # pixels


class DropSign(Label):
    """A sign that is hidden at first, covers its window, and lets the mouse through."""

    def __init__(self, window: QWidget) -> None:
        super().__init__("", window)
        self._window = window
        self.setObjectName("drop")
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.hide()

    def show_over(self, text: str) -> None:
        self.setText(text)
        self.setGeometry(self._window.rect().adjusted(MARGIN, MARGIN, -MARGIN, -MARGIN))
        self.show()
        self.raise_()
