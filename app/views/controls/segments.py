"""Rows of small buttons: a segmented control, of which one is checked, and switches, each on or off."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import QButtonGroup, QHBoxLayout, QToolButton, QWidget

from app.views.controls.parts import tool_button

SMALL = "padding: 2px 8px; border-radius: 4px;"


class Segments(QWidget):
    """Choices are known by their keys; the first is checked at the start."""

    chosen = Signal(str)  # another key, by the user
    clicked = Signal(str)  # a key, also the one that is checked already

    def __init__(self, name: str, choices: Iterable[tuple[str, str, str]], parent: QWidget | None = None) -> None:
        """`choices`: (key, text, tip) each."""
        super().__init__(parent)
        self.setAccessibleName(name)
        self._group = QButtonGroup(self)
        self._keys: list[str] = []
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(2)
        for key, text, tip in choices:
            button = _button(key, text, name, tip)
            button.setChecked(not self._keys)
            self._group.addButton(button, len(self._keys))
            self._keys.append(key)
            row.addWidget(button)
        self._group.idToggled.connect(self._toggled)
        self._group.idClicked.connect(lambda row: self.clicked.emit(self._keys[row]))

    @property
    def key(self) -> str:
        """The choice that is checked."""
        return self._keys[self._group.checkedId()]

    def show_key(self, key: str) -> None:
        with QSignalBlocker(self._group):
            self._group.button(self._keys.index(key)).setChecked(True)

    def _toggled(self, row: int, down: bool) -> None:
        if down:
            self.chosen.emit(self._keys[row])


class Switches(QWidget):
    """Choices are known by their keys; all are off at the start."""

    switched = Signal(str, bool)  # a key, and whether it is on now

    def __init__(self, name: str, choices: Iterable[tuple[str, str, str]], parent: QWidget | None = None) -> None:
        """`choices`: (key, text, tip) each."""
        super().__init__(parent)
        self.setAccessibleName(name)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(2)
        for key, text, tip in choices:
            button = _button(key, text, name, tip)
            button.toggled.connect(partial(self.switched.emit, key))
            row.addWidget(button)


def _button(key: str, text: str, name: str, tip: str) -> QToolButton:
    button = tool_button(text, f"{name}: {text}", tip)
    button.setObjectName(key)
    button.setCheckable(True)
    button.setStyleSheet(SMALL)
    return button
