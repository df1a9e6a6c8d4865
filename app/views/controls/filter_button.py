"""A button that is there while a browser's list is filtered. Previous and next go through what is left of it."""

from __future__ import annotations

from PySide6.QtWidgets import QToolButton, QWidget


class FilterButton(QToolButton):
    """The number of rows that pass a filter; a click asks to clear it.

    Args:
        what: the rows, such as presets.
    """

    def __init__(self, what: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._what = what
        self.setObjectName("filter")
        self.hide()

    def show_listed(self, listed: int, total: int) -> None:
        """Show the number of rows that pass the filter."""
        self.setVisible(listed < total)
        self.setText(f"{listed} of {total}  ✕")
        self.setAccessibleName(f"Filtered: {listed} of {total} {self._what}; clear the filter")
        self.setToolTip(
            f"{listed} of {total} {self._what} match the filter; previous and next step through these.\n"
            "Click to clear the filter"
        )
