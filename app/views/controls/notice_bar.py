"""The latest notice, over the window: what went wrong, and what to do. Earlier ones are in a list."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime

from PySide6.QtCore import QEvent, QPoint, Qt, QTimer, Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QToolButton, QWidget

from app.shared.log import log_file
from app.views.controls.notice_list import Notice, NoticeList
from app.views.controls.parts import tool_button
from app.views.controls.plain import Label
from engine.plain_text import one_line

MOST_KEPT = 50
INFORMED_MS = 8000  # a notice that is no error hides by itself


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
        self._notices: list[Notice] = []
        self._list: NoticeList | None = None
        self._hide = QTimer(self, interval=INFORMED_MS, singleShot=True)
        self._hide.timeout.connect(self.hide)
        self.faulted.connect(self._report_fault, Qt.ConnectionType.QueuedConnection)
        self.bell = Bell()  # placed by the window
        self.bell.clicked.connect(self.show_all)
        self._label = Label()
        self._label.setWordWrap(True)
        self._label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._details = tool_button("Details", "Notice details", "Show the error details, which can be copied (F8)")
        self._details.clicked.connect(self.show_all)
        dismiss = tool_button("Dismiss", "Dismiss the notice", "Dismiss (kept in the list)")
        dismiss.clicked.connect(self._dismiss)
        for button in (self._details, dismiss):
            button.setObjectName("small")
        row = QHBoxLayout(self)
        row.setContentsMargins(10, 3, 4, 3)
        row.addWidget(self._label, 1)
        row.addWidget(self._details)
        row.addWidget(dismiss)
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
        *_, error = text.strip().splitlines()
        self.report(f"{sentence} {one_line(error)}", f"{text}\nPlease report it. It is also in {log_file()}.")

    def inform(self, message: str, details: str = "") -> None:
        """Show a message that is no error."""
        self._take(Notice(message, details, error=False))

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
        """Hide the notice, which has been read."""
        self.hide()
        self.bell.set_unseen(max(0, self.bell.unseen - 1))

    def _fit(self) -> None:
        self.resize(self.width(), self.heightForWidth(self.width()))

    def _take(self, notice: Notice) -> None:
        earlier = next((old for old in self._notices if old.message == notice.message), None)
        if earlier is not None:
            self._notices.remove(earlier)
        times = 1 if earlier is None else earlier.times + 1
        now = f"{datetime.now():%H:%M:%S}"
        self._notices = [*self._notices, replace(notice, times=times, last_reported=now)][-MOST_KEPT:]
        self._label.setObjectName("warning" if notice.error else "")
        self._label.style().polish(self._label)
        self._label.setText(self._notices[-1].line)
        self._details.setVisible(notice.details not in notice.message)
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

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.unseen = 0
        self.set_unseen(0)

    def set_unseen(self, unseen: int) -> None:
        self.unseen = unseen
        state = f"{unseen} unread" if unseen else "none unread"
        self.setText(f"⚑ {min(unseen, 99)}" if unseen else "⚑")
        self.setAccessibleName(f"Notices, {state}")
        self.setToolTip(f"Notices: errors and messages since the start, {state} (F8)")
