"""One line for what went wrong and what to do; earlier notices can be recalled."""

from __future__ import annotations

from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QMessageBox, QWidget

from app.views.parts import tool_button

MOST_KEPT = 50


class NoticeBar(QFrame):
    """Hidden until there is something to say. The same notice is not repeated while it stands."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("panel")
        self.setAccessibleName("Notice")
        self._kept: list[tuple[str, str]] = []
        self._label = QLabel()
        self._label.setObjectName("warning")
        self._label.setWordWrap(True)
        details = tool_button("Details")
        details.clicked.connect(self.show_all)
        dismiss = tool_button("Dismiss")
        dismiss.clicked.connect(self.hide)
        row = QHBoxLayout(self)
        row.setContentsMargins(10, 4, 6, 4)
        row.addWidget(self._label, 1)
        row.addWidget(details)
        row.addWidget(dismiss)
        self.hide()

    @property
    def text(self) -> str:
        """The notice that stands, or nothing."""
        return self._label.text() if not self.isHidden() else ""

    @property
    def kept(self) -> list[tuple[str, str]]:
        """All notices of this run, latest last: (message, details)."""
        return list(self._kept)

    def tell(self, message: str, details: str = "") -> None:
        if self.text == message:
            return
        self._kept = [*self._kept, (message, details)][-MOST_KEPT:]
        self._label.setText(message)
        self.show()

    def withdraw(self, message: str) -> None:
        """Takes a notice down that is no longer true; it can still be recalled."""
        if self.text == message:
            self.hide()

    def show_all(self) -> None:
        """The notices of this run in a dialog, with what the system said, to copy."""
        text = "\n\n".join(message + (f"\n{details}" if details else "") for message, details in reversed(self._kept))
        box = QMessageBox(
            QMessageBox.Icon.Information, "Notices", self._kept[-1][0] if self._kept else "None", parent=self
        )
        box.setDetailedText(text)
        copy = box.addButton("Copy all", QMessageBox.ButtonRole.ActionRole)
        box.addButton(QMessageBox.StandardButton.Close)
        box.exec()
        if box.clickedButton() is copy:
            QGuiApplication.clipboard().setText(text)
