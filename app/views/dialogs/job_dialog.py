"""What dialogs that export have in common: choices, then progress that can be cancelled, then the result."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from PySide6.QtCore import QCoreApplication, QEvent, Qt, QUrl
from PySide6.QtGui import QDesktopServices, QKeyEvent
from PySide6.QtWidgets import QDialog, QHBoxLayout, QProgressBar, QPushButton, QVBoxLayout, QWidget

from app.export.files import ExportError
from app.export.recipe import RecipeError
from app.shared.worker import Work
from app.views.background import Background
from app.views.controls.parts import label
from engine.plain_text import duration
from engine.presets import PresetError
from engine.sources import Runaway

EXPECTED = (ExportError, PresetError, RecipeError, Runaway, ValueError)  # their messages are for the user


class JobDialog(QDialog):
    """A subclass lays out its choices (`_lay_out`), and starts work on them (`_run`).

    Args:
        meanwhile: a sentence beside the progress: what the parent's window can be used for. The keyboard goes there
            while a job runs; Escape in the dialog still cancels.

    Attributes:
        state: a line or more on what is to come, on progress, or on the result.
        save: the button that starts.
    """

    def __init__(self, title: str, width: int, parent: QWidget | None = None, meanwhile: str = "") -> None:
        super().__init__(parent)
        self.setWindowTitle(title)
        self.setMinimumWidth(width)
        self._meanwhile = f". {meanwhile}" if meanwhile else ""
        self._borrower = parent.window() if parent is not None and meanwhile else None  # of the keyboard
        self._job = Background(title, self, expected=EXPECTED)
        self._job.progressed.connect(self._tell_progress)
        self._job.finished.connect(self._finish)
        self._job.failed.connect(self._fail)
        self._job.cancelled.connect(self._give_up)
        self._shown_folder = Path()
        self._choosers: tuple[QWidget, ...] = ()

    @abstractmethod
    def _start(self) -> None:
        """The button was pressed: calls `_run`."""

    @abstractmethod
    def _show_choices(self) -> None:
        """What the choices would give. Called after each end of a job, before its result is shown."""

    def _lay_out(self, parts: Sequence[QWidget], choosers: Sequence[QWidget], state_height: int) -> None:
        """`parts` from top to bottom; `choosers` are those that cannot be changed while a job runs."""
        self._choosers = tuple(choosers)
        self.state = label("faint", selectable=True)
        self.state.setMinimumHeight(state_height)
        self.state.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.bar = QProgressBar(maximum=1000)
        self.bar.setAccessibleName("Progress")
        self.show_folder = QPushButton("Show in folder")
        self.show_folder.setToolTip("Open the folder of what was saved")
        self.show_folder.clicked.connect(self._open_folder)
        self.save = QPushButton("Export", default=True)
        self.save.setObjectName("primary")
        self.save.setToolTip("Render and save")
        self.save.clicked.connect(self._start)
        self.close_button = QPushButton("Close")
        self.close_button.setToolTip("Close, or cancel the rendering (Escape)")
        self.close_button.clicked.connect(self._cancel_or_close)
        buttons = QHBoxLayout()
        buttons.addWidget(self.show_folder)
        buttons.addStretch(1)
        buttons.addWidget(self.close_button)
        buttons.addWidget(self.save)
        column = QVBoxLayout(self)
        column.setSpacing(12)
        for part in parts:
            column.addWidget(part)
        column.addStretch(1)
        column.addWidget(self.bar)
        column.addWidget(self.state)
        column.addLayout(buttons)
        self.bar.hide()
        self.show_folder.hide()

    def _run(
        self,
        work: Work,
        told: Callable[[Any], None],
        cancelled: Callable[[], None],
        folder: Path,
        begins: str = "Rendering …",
    ) -> None:
        """Starts work in its thread; one of `told`, with what it returned, and `cancelled` is to call `_end`."""
        self._shown_folder = folder
        self._started_s = time.monotonic()
        self._told, self._cancelled = told, cancelled
        for part in (*self._choosers, self.save):
            part.setEnabled(False)
        self.show_folder.hide()
        self.close_button.setText("Cancel")
        self.bar.setValue(0)
        self.bar.show()
        self._say(begins)
        self._job.start(work)
        self._lend_keyboard(True)

    def _lend_keyboard(self, lent: bool) -> None:
        """While a tool window has the focus, its parent's shortcuts work (`QShortcut`)."""
        if self._borrower is None:
            return
        kind = Qt.WindowType.Tool if lent else Qt.WindowType.Dialog
        self.overrideWindowFlags((self.windowFlags() & ~Qt.WindowType.WindowType_Mask) | kind)
        if lent:
            self._borrower.activateWindow()

    def event(self, event: QEvent) -> bool:
        """Passes keys on to the parent's window while a job lends it the keyboard, all but Escape."""
        if isinstance(event, QKeyEvent) and self._job.busy and self._borrower is not None:
            if event.key() == Qt.Key.Key_Escape:
                event.accept()  # no shortcut of the window
            elif event.type() != QEvent.Type.ShortcutOverride:
                return QCoreApplication.sendEvent(self._borrower, event)
        return super().event(event)

    def _tell_progress(self, share: float, text: str, left_s: float | None) -> None:
        self.bar.setValue(round(1000 * share))
        left_s = self._left_s(share) if left_s is None else left_s
        left = f", about {duration(left_s)} left" if left_s else ""
        self._say(f"{text or 'Rendering'}{left}{self._meanwhile}")

    def _left_s(self, share: float) -> float:
        """The time left by the share that is done; 0 where it is not known."""
        return (time.monotonic() - self._started_s) * (1 - share) / share if share > 0 else 0.0

    def _finish(self, result: object) -> None:
        self._told(result)

    def _fail(self, message: str) -> None:
        self._end(message, failed=True)

    def _give_up(self) -> None:
        self._cancelled()

    def done(self, result: int) -> None:
        """Closes the dialog. A job under way is cancelled and waited for; what is whole is kept."""
        self._job.close(None)
        super().done(result)

    def _end(self, text: str, failed: bool = False, saved: bool = False) -> None:
        """The job is over, with this result. `saved`: there are files to show."""
        self._lend_keyboard(False)
        self.bar.hide()
        for part in (*self._choosers, self.save):
            part.setEnabled(True)
        self.close_button.setText("Close")
        self._show_choices()
        self._say(text, failed)
        self.show_folder.setVisible(saved)

    def _say(self, text: str, failed: bool = False) -> None:
        self.state.setObjectName("warning" if failed else "faint")
        self.state.style().polish(self.state)
        self.state.setText(text)

    def _open_folder(self) -> None:
        if not QDesktopServices.openUrl(QUrl.fromLocalFile(str(self._shown_folder))):
            self._say(f"No file manager was found here; the folder is {self._shown_folder}.")

    def _cancel_or_close(self) -> None:
        if self._job.busy:
            self._job.stop()
        else:
            self.accept()

    def reject(self) -> None:
        self._cancel_or_close()
