"""The latest notice, over the window: what went wrong, and what to do; and the list of all, with their details."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from PySide6.QtCore import QEvent, QMargins, QPoint, Qt, QTimer, Signal
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QDialog, QFrame, QHBoxLayout, QListWidget, QToolButton, QVBoxLayout, QWidget

from app.shared.log import log_file
from app.views.controls.parts import filled, label, push_button, read_only_text, show_kind, tool_button
from app.views.controls.plain import Label
from app.views.file_manager import reveal
from engine.plain_text import one_line

MOST_KEPT = 50
INFORMED_MS = 8000  # a notice that is no error hides by itself


@dataclass(frozen=True)
class Notice:
    """A notice of a fault or a fact worth knowing: a message, how often it was shown, and when last."""

    message: str
    details: str = ""
    error: bool = True  # False: information
    file: Path | None = None  # that was saved
    times: int = 1
    last_reported: str = ""  # hours:minutes:seconds

    @property
    def line(self) -> str:
        return self.message + (f"  (×{self.times})" if self.times > 1 else "")


class NoticeBar(QFrame):
    """A bar that is hidden while there is no notice.

    A repeated notice raises its count instead of being listed twice.

    It lies over its parent, of which it takes no room.
    """

    faulted = Signal(str, str)  # an unexpected error, emitted in any thread: a sentence, and the traceback

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("notice")
        self.setAccessibleName("Notice")
        self._notices: list[Notice] = []  # of this run, the latest last, MOST_KEPT at most
        self._list: NoticeList | None = None  # the dialog of all; None: it was not opened yet
        self._hide = QTimer(self, interval=INFORMED_MS, singleShot=True)
        self._hide.timeout.connect(self.hide)
        self.faulted.connect(self._report_fault, Qt.ConnectionType.QueuedConnection)
        self.bell = Bell()  # placed by the window
        self.bell.clicked.connect(self.show_all)
        self._label = label(selectable=True)
        tip = "Show the error details, which can be copied (F8)"
        self._details = tool_button("Details", "Notice details", tip, "small", self.show_all)
        tip = "Dismiss (kept in the list)"
        dismiss = tool_button("Dismiss", "Dismiss the notice", tip, "small", self._dismiss)
        tip = "Show the saved file in the file manager"
        self._reveal = tool_button("Show in folder", tip=tip, kind="small", pressed=self.reveal, visible=False)
        buttons = self._reveal, self._details, dismiss
        row = filled(QHBoxLayout(self), self._label, *buttons, margins=QMargins(10, 3, 4, 3))
        row.setStretch(0, 1)
        self.hide()

    @property
    def text(self) -> str:
        """The notice that is shown; "" where none is."""
        return self._notices[-1].message if self._notices and not self.isHidden() else ""

    @property
    def notices(self) -> list[Notice]:
        """The notices of this run, the latest last."""
        return list(self._notices)

    def report(self, message: str, details: str = "") -> None:
        """Show an error; the message says what to do about it."""
        self._take(Notice(message, details))

    def _report_fault(self, sentence: str, text: str) -> None:
        """Show an unexpected error: a sentence with the last line of its traceback, which the details hold."""
        *_, error = text.strip().splitlines()
        self.report(f"{sentence} {one_line(error)}", f"{text}\nPlease report it. It is also in {log_file()}.")

    def inform(self, message: str, details: str = "", file: Path | None = None) -> None:
        """Show a message that is no error. `file`: that was saved, which a button shows in its folder."""
        self._take(Notice(message, details, error=False, file=file))

    def reveal(self) -> None:
        """Show the file that was saved last in its folder."""
        file = next((notice.file for notice in reversed(self._notices) if notice.file is not None), None)
        if file is None:
            self.inform("Nothing was saved since the start.")
        else:
            reveal(file, self.report)

    def withdraw(self, message: str) -> None:
        """Hide a notice that is no longer true; it stays in the list."""
        if self.text == message:
            self.hide()

    def show_all(self) -> None:
        """Open the list of all notices of this run, with their details."""
        if self._list is None:
            self._list = NoticeList(self.window())
        self._list.set_notices(self.notices)
        self._list.show()
        self._list.raise_()
        self.bell.set_unseen(0)

    def place(self, corner: QPoint, width: int) -> None:
        """Set its upper left corner and its width; it is as high as its text needs."""
        self.move(corner)
        self.setFixedWidth(width)
        self._fit()

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.LayoutRequest:  # another text
            self._fit()
        return super().event(event)

    def _dismiss(self) -> None:
        self.hide()
        self.bell.set_unseen(max(0, self.bell.unseen - 1))

    def _fit(self) -> None:
        self.resize(self.width(), self.heightForWidth(self.width()))

    def _take(self, notice: Notice) -> None:
        """Show a notice and list it last, with its count where it was listed before; hide it later if no error."""
        earlier = next((old for old in self._notices if old.message == notice.message), None)
        if earlier is not None:
            self._notices.remove(earlier)
        times = 1 if earlier is None else earlier.times + 1
        now = f"{datetime.now():%H:%M:%S}"
        self._notices = [*self._notices, replace(notice, times=times, last_reported=now)][-MOST_KEPT:]
        show_kind(self._label, "warning" if notice.error else "")
        self._label.setText(self._notices[-1].line)
        self._details.setVisible(notice.details not in notice.message)
        self._reveal.setVisible(notice.file is not None)
        self._fit()
        self.show()
        self.raise_()
        if notice.error:
            self._hide.stop()
        else:
            self._hide.start()
        self.bell.set_unseen(self.bell.unseen + (earlier is None))
        if self._list is not None:
            self._list.set_notices(self.notices)


class Bell(QToolButton):
    """The button that opens the list, with the number of notices that have not been seen there."""

    def __init__(self) -> None:
        super().__init__()
        self.set_unseen(0)

    def set_unseen(self, unseen: int) -> None:
        self.unseen = unseen
        state = f"{unseen} unread" if unseen else "none unread"
        self.setText(f"⚑ {min(unseen, 99)}" if unseen else "⚑")
        self.setAccessibleName(f"Notices, {state}")
        self.setToolTip(f"Notices: errors and messages since the start, {state} (F8)")


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
        tip = "Copy all notices with their details, for a bug report"
        copy = push_button("Copy all", tip, pressed=lambda: QGuiApplication.clipboard().setText(self.report()))
        close = push_button("Close", pressed=self.accept, default=True, autoDefault=True)
        buttons = filled(QHBoxLayout(), copy, None, close)
        column = filled(QVBoxLayout(self), self._list, Label("Details"), self._details, buttons)
        column.setStretch(0, 3)
        column.setStretch(2, 2)

    def set_notices(self, notices: Sequence[Notice]) -> None:
        self._notices = list(reversed(notices))
        self._list.clear()
        for notice in self._notices:
            self._list.addItem(f"{notice.last_reported}   {'error' if notice.error else 'note'}   {notice.line}")
        if self._notices:
            self._list.setCurrentRow(0)
        else:
            self._details.setPlainText("No notices since the start.")

    def report(self) -> str:
        return "\n\n".join(
            f"{notice.last_reported} {notice.line}" + (f"\n{notice.details}" if notice.details else "")
            for notice in self._notices
        )

    def _show_details(self, row: int) -> None:
        if 0 <= row < len(self._notices):
            notice = self._notices[row]
            self._details.setPlainText(f"{notice.message}\n\n{notice.details}".strip())
