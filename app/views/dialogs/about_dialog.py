"""About: version, licence, the paper, the files and folders; all of it to copy for a bug report."""

from __future__ import annotations

from PySide6.QtWidgets import QDialog, QVBoxLayout, QWidget

from app.views.controls.parts import copy_and_close, filled, read_only_text
from app.views.controls.plain import Label


class AboutDialog(QDialog):
    """The first line of `text` is the title."""

    def __init__(self, text: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        title, _, rest = text.partition("\n")
        self.setWindowTitle("About")
        self.resize(620, 460)
        heading = Label(title)
        heading.setObjectName("title")
        shown = read_only_text("About this program", rest.strip())
        last = copy_and_close(self, lambda: text, "Copy", "Copy this text, for a bug report")
        filled(QVBoxLayout(self), heading, shown, last)
