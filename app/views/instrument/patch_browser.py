"""The patch browser: a search, a list under the categories and a card. It stays open meanwhile.

type              filters the list (words in any order)
arrows            move in the list, load and play a note
Space             plays a note; in a search that has begun it is a blank
Ctrl+D            makes a favourite, or no longer
Enter, Escape     close
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFrame, QWidget

if TYPE_CHECKING:
    from app.patches.library import PatchEntry


class PatchBrowser(QFrame):
    """Shows what it is given; hidden at first."""

    chosen = Signal(str)  # the name of an entry: to be loaded
    audition_asked = Signal(str)  # to be heard
    favourite_asked = Signal(str)  # to be one, or no longer
    rename_asked = Signal(str)
    delete_asked = Signal(str)
    folder_asked = Signal()
    file_dropped = Signal(str)  # the path of a .json
    listed_changed = Signal()
    opened = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("browser")
        self.setAccessibleName("Patch browser")
        self.hide()

    def show_entries(self, entries: Sequence[PatchEntry], favourites: Collection[str], chosen: str) -> None:
        """All patches there are."""

    def set_chosen(self, name: str) -> None:
        """Which one is loaded."""

    @property
    def listed(self) -> tuple[str, ...]:
        """The names that pass the filter, in the order shown: previous and next go through these."""
        return ()

    def show_over(self) -> None:
        """Opens with the keyboard in the search."""

    def dismiss(self) -> None:
        self.hide()
