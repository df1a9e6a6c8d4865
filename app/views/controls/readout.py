"""A faint line that says what the mouse points at. It takes the room it is given and never asks for more."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.views.controls.elided_label import ElidedLabel
from app.views.controls.plain import plain_tip


class Readout(ElidedLabel):
    """A line that shows the text of `rest` while that of `tell` is empty."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("faint")
        self.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self._resting: tuple[str, ...] = ("",)
        self._reported: tuple[str, ...] = ("",)

    def rest(self, text: str, *shorter: str) -> None:
        self._resting = (text, *shorter)
        self.report(*self._reported)

    def report(self, text: str, *shorter: str) -> None:
        """Show the thing that the mouse points at; "" for nothing. `shorter` as in `ElidedLabel.say`."""
        self._reported = (text, *shorter)
        wordings = self._reported if text else self._resting
        if wordings[0] != self.text():
            self.say(*wordings)
            # where there is too little room for it
            self.setToolTip(plain_tip(wordings[0]))
