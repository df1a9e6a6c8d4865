"""Rows of small buttons: a segmented control, of which one is checked, and switches, each on or off."""

from __future__ import annotations

from collections.abc import Iterable

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import QButtonGroup, QHBoxLayout, QWidget

from app.views.controls.parts import NO_MARGINS, SMALL, filled, tool_button


class Segments(QWidget):
    """Choices are known by their keys; the first is checked at the start, of switches none.

    Args:
        choices: (key, text, tip) each.
        switches: each is on or off for itself.
    """

    chosen = Signal(str)  # another key, by the user
    clicked = Signal(str)  # a key, also the one that is checked already
    switched = Signal(str, bool)  # a key, and whether it is on now

    def __init__(self, name: str, choices: Iterable[tuple[str, str, str]], switches: bool = False) -> None:
        super().__init__()
        self.setAccessibleName(name)
        self._group = QButtonGroup(self)
        self._keys: list[str] = []
        row = filled(QHBoxLayout(self), spacing=2, margins=NO_MARGINS)
        for place, (key, text, tip) in enumerate(choices):
            button = tool_button(text, f"{name}: {text}", tip, key, checkable=True)
            button.setStyleSheet(SMALL)
            button.setChecked(not switches and not self._keys)
            if switches:  # in a group, Tab and the arrow keys would reach the first alone
                button.toggled.connect(lambda down, place=place: self._toggled(place, down))
                button.clicked.connect(lambda _=False, key=key: self.clicked.emit(key))
            else:
                self._group.addButton(button, place)
            self._keys.append(key)
            row.addWidget(button)
        self._group.idToggled.connect(self._toggled)
        self._group.idClicked.connect(lambda row: self.clicked.emit(self._keys[row]))

    @property
    def key(self) -> str:
        return self._keys[self._group.checkedId()]

    def show_key(self, key: str) -> None:
        with QSignalBlocker(self._group):
            self._group.button(self._keys.index(key)).setChecked(True)

    def _toggled(self, row: int, down: bool) -> None:
        self.switched.emit(self._keys[row], down)
        if down:
            self.chosen.emit(self._keys[row])
