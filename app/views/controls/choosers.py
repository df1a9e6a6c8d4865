"""Buttons of a bar that chooses from a browser's list: the chosen name, and the filter while there is one."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QPushButton, QSizePolicy, QToolButton

from app.views.controls.parts import Handler

PADDING = 26  # of the style sheet, with the borders


class NameButton(QPushButton):
    """A name that opens the browser, cut in the middle: presets of one string differ at their ends."""

    def __init__(self, text: str, tip: str, pressed: Handler, narrowest: int, widest: int) -> None:
        super().__init__()
        self.setObjectName("preset")
        self.setToolTip(tip)
        self.setMinimumWidth(narrowest)
        self.setMaximumWidth(widest)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setText(text)
        self.clicked.connect(pressed)

    def setText(self, text: str) -> None:
        self._full_text = text
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        cut, room = Qt.TextElideMode.ElideMiddle, self.width() - PADDING
        super().setText(self.fontMetrics().elidedText(self._full_text, cut, room, Qt.TextFlag.TextShowMnemonic))


class FilterButton(QToolButton):
    """The number of rows that pass a filter, hidden while all do; a click asks to clear it.

    Previous and next go through what is left. `what`: the rows, such as presets.
    """

    def __init__(self, what: str, pressed: Handler) -> None:
        super().__init__()
        self.setObjectName("filter")
        self.hide()
        self._what = what
        self.clicked.connect(pressed)

    def show_listed(self, listed: int, total: int) -> None:
        self.setVisible(listed < total)
        self.setText(f"{listed} of {total}  ✕")
        self.setAccessibleName(f"Filtered: {listed} of {total} {self._what}; clear the filter")
        self.setToolTip(
            f"{listed} of {total} {self._what} match the filter; previous and next step through these.\n"
            "Click to clear the filter"
        )
