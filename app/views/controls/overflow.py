"""The controls of a row that have no room. A button is there with them, whose menu has each of them."""

from __future__ import annotations

import textwrap

from PySide6.QtGui import QAction
from PySide6.QtWidgets import QAbstractButton, QLabel, QMenu, QToolButton, QWidget

from app.views.controls.plain import plain_tip

LINE_LETTERS = 64  # of words in the menu


class Overflow(QToolButton):
    """A menu button for a row of controls, which hides what does not fit and hands it over with `hold`.

    A button's entry in the menu presses it; a label's words are shown. Without parts the menu button is hidden.

    Attributes:
        parts: what is in the menu.
    """

    def __init__(self, of: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.parts: tuple[QWidget, ...] = ()
        self.setText("⋯")
        self.setObjectName("narrow")
        self.setAccessibleName(f"More of {of}")
        self.setToolTip(f"What of {of} has no room here")
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        menu = QMenu(self)
        menu.setToolTipsVisible(True)
        menu.aboutToShow.connect(self._fill)
        self.setMenu(menu)
        self.hide()

    def hold(self, *parts: QWidget) -> None:
        """Hold these parts from now on, in place of those before."""
        self.parts = parts
        self.setVisible(bool(parts))

    def _fill(self) -> None:
        """Fill the menu with the present parts as it opens: entries for buttons, then the words of labels."""
        menu = self.menu()
        menu.clear()
        for part in self.parts:
            if isinstance(part, QAbstractButton):
                action = QAction(part.text(), menu, checkable=part.isCheckable(), checked=part.isChecked())
                action.setEnabled(part.isEnabled())
                action.setToolTip(plain_tip(part.toolTip()))
                if isinstance(part, QToolButton) and part.menu() is not None:
                    action.setMenu(part.menu())
                action.triggered.connect(part.click)
                menu.addAction(action)
        menu.addSeparator()
        for part in self.parts:
            if isinstance(part, QLabel):
                for line in textwrap.wrap(part.text(), LINE_LETTERS):
                    menu.addAction(line.replace("&", "&&")).setEnabled(False)
