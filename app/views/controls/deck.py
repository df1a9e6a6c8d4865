"""Several views in one place, one of them in front: a strip of names above it."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import QTabWidget, QWidget


class Deck(QTabWidget):
    """Views are known by their keys."""

    chosen = Signal(str)  # a key, by the user

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName(name)
        # its tab bar has the keyboard, by itself: both would hold the Tab key
        self.setFocusProxy(None)  # type: ignore[arg-type]
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.tabBar().setAccessibleName(name)
        self.setDocumentMode(True)
        self.setUsesScrollButtons(True)
        self._keys: list[str] = []
        self.currentChanged.connect(lambda row: self.chosen.emit(self._keys[row]))

    def add(self, key: str, title: str, view: QWidget) -> None:
        self._keys.append(key)
        with QSignalBlocker(self):
            self.addTab(view, title)

    def show_key(self, key: str) -> None:
        """Bring a view to the front; a key that is none of this deck's changes nothing."""
        if key in self._keys:
            with QSignalBlocker(self):
                self.setCurrentIndex(self._keys.index(key))
