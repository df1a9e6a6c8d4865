"""About: version, licence, the paper, the files and folders; all of it to copy for a bug report."""

from __future__ import annotations

from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QDialog, QHBoxLayout, QPlainTextEdit, QPushButton, QVBoxLayout, QWidget

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
        body = QPlainTextEdit(rest.strip(), readOnly=True)
        body.setAccessibleName("About this program")
        body.setTabChangesFocus(True)
        copy = QPushButton("Copy")
        copy.setToolTip("Copy this text, for a bug report")
        copy.clicked.connect(lambda: QGuiApplication.clipboard().setText(text))
        close = QPushButton("Close", default=True)
        close.clicked.connect(self.accept)
        buttons = QHBoxLayout()
        buttons.addWidget(copy)
        buttons.addStretch(1)
        buttons.addWidget(close)
        column = QVBoxLayout(self)
        column.addWidget(heading)
        column.addWidget(body)
        column.addLayout(buttons)
