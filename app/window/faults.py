"""Unexpected errors, of any thread, in one dialog."""

from __future__ import annotations

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QWidget

from app.shared.log import log_file
from app.views.dialogs.fault_dialog import FaultDialog

UNEXPECTED = "An unexpected error. Sound and picture may continue; if they do not, restart the program."


class Faults(QObject):
    """`tell` may be called from any thread."""

    _reported = Signal(str, str)

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self.dialog: FaultDialog | None = None
        self._reported.connect(self._show, Qt.ConnectionType.QueuedConnection)

    def report(self, text: str, heading: str = UNEXPECTED) -> None:
        """Shows an error in the dialog; `heading` is that of the first one."""
        self._reported.emit(text, heading)

    def _show(self, text: str, heading: str) -> None:
        if self.dialog is None:
            self.dialog = FaultDialog(log_file(), heading, self._window)
        self.dialog.add(text)
