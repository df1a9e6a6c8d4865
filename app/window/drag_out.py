"""Notes and recordings, handed to other programs as files: dragged from the window, or copied to the clipboard."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QObject
from PySide6.QtGui import QGuiApplication

from app.export.choices import ExportChoices
from app.export.handed_files import HandedFiles
from app.export.job import EXPECTED
from app.export.note import HeardNote
from app.shared.worker import Job
from app.views.background import Background
from app.views.controls.drag_handle import Handed, file_data
from app.views.dialogs.export_pages import PAGES, HeardPerformance, Kind
from app.window.exports import Exports
from app.window.main_window import MainWindow
from app.window.recordings import Recordings

Take = Callable[[list[Path]], None]


class DragOut(QObject):
    """The files are rendered in the background, as an export with its last choices would be, and then given."""

    def __init__(self, window: MainWindow, exports: Exports, recordings: Recordings) -> None:
        super().__init__(window)
        self._window, self._exports = window, exports
        self._handle = handle = window.transport.handle
        self._files = HandedFiles()
        self._asked: object = None  # what is rendered, or was
        self._ready: list[Path] = []  # its files
        self._take: Take = self._offer
        self._background = Background("files", self, expected=EXPECTED)
        self._background.progressed.connect(lambda share, *_: handle.show_share(share))
        self._background.finished.connect(self._give)
        self._background.failed.connect(self._fail)
        handle.wanted.connect(lambda: self._prepare(handle.subject, self._offer))
        handle.copy_asked.connect(lambda: self.copy(handle.subject))
        recordings.unsaved_changed.connect(lambda: handle.show_recorded(recordings.offered is not None))

    def copy(self, subject: Handed) -> None:
        """Put the file on the clipboard, from which a file manager pastes it."""
        self._prepare(subject, self._copy)

    def close(self) -> None:
        """End what is rendered and remove the files; may be called again."""
        self._background.close(None)
        self._files.close()

    def _prepare(self, handed: Handed, take: Take) -> None:
        """Give the files to `take` once they are rendered, unless they are there already."""
        kind: Kind = "performance" if handed == "recording" else "note"
        subject, choices = self._exports.subjects[kind], self._exports.choices[0]
        if subject is None:
            self._window.notices.report(PAGES[kind].missing)
            return
        if kind == "note":
            source = "difference" if handed == "difference" else subject.chosen(choices.source)
            choices = choices.model_copy(update={"source": source})
        bits = choices.format.split()[1]
        choices = choices.model_copy(update={"format": f"wav {bits}"})  # which every program reads
        self._take, asked = take, (subject, choices)
        if asked != self._asked or not (self._background.busy or all(file.is_file() for file in self._ready)):
            self._asked = asked
            self._background.start(lambda job: self._rendered(subject, choices, job))
        elif not self._background.busy:
            take(self._ready)

    def _rendered(self, subject: HeardNote | HeardPerformance, choices: ExportChoices, job: Job) -> list[Path]:
        """The files of a subject, which are sounds."""
        folder = self._files.new_folder()
        subject.export(choices, folder).run(job.progress)
        return sorted(file for file in folder.iterdir() if file.suffix != ".mid")

    def _give(self, files: list[Path]) -> None:
        self._ready = files
        self._handle.show_share(None)
        self._take(files)

    def _fail(self, message: str, details: str) -> None:
        self._asked = None
        self._handle.show_share(None)
        self._window.notices.report(message, details)

    def _offer(self, files: list[Path]) -> None:
        self._handle.offer(files)
        if self._handle.pulled:  # and released since
            self._window.say_briefly("Rendered: drag it now")

    def _copy(self, files: list[Path]) -> None:
        QGuiApplication.clipboard().setMimeData(file_data(files))
        names = " and ".join(file.name for file in files)
        self._window.notices.inform(f"Copied {names}: paste in a file manager.")
