"""The notices of this run, the latest first, each with its details, to copy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QDialog, QHBoxLayout, QListWidget, QPushButton, QVBoxLayout, QWidget

from app.views.controls.parts import filled, push_button, read_only_text
from app.views.controls.plain import Label


@dataclass(frozen=True)
class Notice:
    """A notice of a fault or a fact worth knowing: a message, how often it was shown, and when last."""

    message: str
    details: str = ""
    error: bool = True  # False: information
    times: int = 1
    last_reported: str = ""  # hours:minutes:seconds

    @property
    def line(self) -> str:
        return self.message + (f"  (×{self.times})" if self.times > 1 else "")


class NoticeList(QDialog):
    """A list that does not block the window, and shows new notices while it is open."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Notices")
        self.resize(640, 420)
        self._notices: list[Notice] = []
        self._list = QListWidget()
        self._list.setAccessibleName("Notices since the start")
        self._list.setWordWrap(True)
        self._list.currentRowChanged.connect(self._show_details)
        self._details = read_only_text("Details")
        column = QVBoxLayout(self)
        column.addWidget(self._list, 3)
        column.addWidget(Label("Details"))
        column.addWidget(self._details, 2)
        copy = push_button("Copy all", "Copy all notices with their details, for a bug report")
        copy.clicked.connect(lambda: QGuiApplication.clipboard().setText(self.report()))
        close = QPushButton("Close", default=True)
        close.clicked.connect(self.accept)
        column.addLayout(filled(QHBoxLayout(), copy, None, close))

    def set_notices(self, notices: Sequence[Notice]) -> None:
        """Show these notices, the latest last."""
        self._notices = list(reversed(notices))
        self._list.clear()
        for notice in self._notices:
            self._list.addItem(f"{notice.last_reported}   {'error' if notice.error else 'note'}   {notice.line}")
        if self._notices:
            self._list.setCurrentRow(0)
        else:
            self._details.setPlainText("No notices since the start.")

    def report(self) -> str:
        """The whole list as text."""
        return "\n\n".join(
            f"{notice.last_reported} {notice.line}" + (f"\n{notice.details}" if notice.details else "")
            for notice in self._notices
        )

    def _show_details(self, row: int) -> None:
        if 0 <= row < len(self._notices):
            notice = self._notices[row]
            self._details.setPlainText(f"{notice.message}\n\n{notice.details}".strip())
