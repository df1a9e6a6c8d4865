"""The dialog of unexpected errors: what happened and where the log is, to copy for a bug report."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import QDialog, QVBoxLayout, QWidget

from app.views.controls.parts import copy_and_close, filled, label, read_only_text

MOST_CHARACTERS = 100_000


class FaultDialog(QDialog):
    """There is one for all errors: further ones are added to its text."""

    def __init__(self, log: Path, heading: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Something went wrong")
        self.resize(680, 420)
        words = label(text=f"{heading}\n\nPlease copy this and report it. It is also in {log}.", selectable=True)
        self._text = read_only_text("What happened")
        last = copy_and_close(self, lambda: self.text, "Copy", "Copy all of this, for a bug report")
        filled(QVBoxLayout(self), words, self._text, last)

    @property
    def text(self) -> str:
        return self._text.toPlainText()

    def add(self, fault: str) -> None:
        """Adds an error and shows the dialog. One that is there already is ignored: it may come with every frame."""
        if fault.strip() in self.text or len(self.text) > MOST_CHARACTERS:
            return
        self._text.appendPlainText(fault)
        self.show()
        self.raise_()
