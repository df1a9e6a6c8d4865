"""Notes and recordings, handed to other programs as files: dragged from the window, or copied to the clipboard."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import QMimeData, QObject, Qt, QUrl
from PySide6.QtGui import QDrag, QGuiApplication

from app.export.job import EXPECTED, ExportJob
from app.shared.worker import Job
from app.views.background import Background
from app.views.controls.drag_handle import Handed, Way
from app.views.dialogs.export_pages import PAGES, Kind
from app.window.exports import Exports
from app.window.main_window import MainWindow
from app.window.recordings import Recordings
from engine.whole_file import WriteError, explain, lasting_folder

LARGEST_BYTES = 2**30  # of all files together; the latest are there however large they are


class DragOut(QObject):
    """The giving of files, which are rendered before in the background, as an export with its last choices."""

    def __init__(self, window: MainWindow, exports: Exports, recordings: Recordings) -> None:
        super().__init__(window)
        self._window, self._exports = window, exports
        self._handle = handle = window.transport.handle
        self._folders: list[Path] = []  # temporary ones, each of one rendering, which a program may still read
        self._latest: tuple[object, list[Path]] = (None, [])  # the sound that was asked for last, and its files
        self._way: Way = "prepare"  # what is done with the files once they are rendered, as asked for last
        self._background = background = Background("files", self, expected=EXPECTED)
        background.progressed.connect(lambda share, *_: handle.show_share(share))
        for ended in (background.finished, background.failed):
            ended.connect(lambda *_: handle.show_share(None))
        background.finished.connect(self._give)
        background.failed.connect(window.notices.report)
        handle.asked.connect(lambda way: self.ask(handle.subject, way))
        recordings.unsaved_changed.connect(
            lambda: handle.show_subject("note" if recordings.offered is None else "recording")
        )

    def ask(self, handed: Handed, way: Way) -> None:
        """Render the files where they are not there yet, then give them.

        Args:
            handed: the note, its difference (model − truth), or the last recording.
            way: "prepare" only renders, and no recording; "drag" begins a drag; "copy" puts the files on the
                clipboard.
        """
        if way == "prepare" and (handed == "recording" or self._background.busy):  # which may be long
            return
        kind: Kind = "performance" if handed == "recording" else "note"
        subject, choices = self._exports.subjects[kind], self._exports.choices[0]
        if subject is None:
            self._window.notices.report(PAGES[kind].missing)
            return
        source = "difference" if handed == "difference" else choices.source
        if handed == "note":
            source = subject.chosen(source)
        wav = choices.format.replace("flac", "wav")  # which every program reads
        choices = choices.model_copy(update={"source": source, "format": wav})
        self._way, (latest, files) = way, self._latest
        if latest == (subject, choices) and files and all(file.is_file() for file in files):
            self._give(files)
        elif latest != (subject, choices) or not self._background.busy:
            self._latest = (subject, choices), []
            self._background.start(partial(self._render, partial(subject.export, choices)))

    def close(self) -> None:
        """End what is rendered and remove the files; may be called again."""
        self._background.close(None)
        for folder in self._folders:
            shutil.rmtree(folder, ignore_errors=True)

    def _render(self, export: Callable[[Path], ExportJob], job: Job) -> list[Path]:
        """Render an export into a temporary folder of its own; return its sound files. Called in the background.

        Before, the oldest folders are removed while all hold more than LARGEST_BYTES, and those of killed processes.

        Raises:
            WriteError: the folder cannot be made.
        """
        parent = Path(tempfile.gettempdir())
        try:
            while sum(file.stat().st_size for folder in self._folders for file in folder.glob("*")) > LARGEST_BYTES:
                shutil.rmtree(self._folders.pop(0), ignore_errors=True)
            folder = lasting_folder(parent, "learned-strings-files")
        except OSError as error:
            raise WriteError(explain(parent, error)) from error
        self._folders.append(folder)
        export(folder).run(job.progress)
        return sorted(file for file in folder.iterdir() if file.suffix != ".mid")

    def _give(self, files: list[Path]) -> None:
        """Give the files, which are whole, in the way that was asked for last."""
        self._latest = self._latest[0], files
        data = QMimeData()
        data.setUrls([QUrl.fromLocalFile(str(file)) for file in files])
        if self._way == "copy":
            QGuiApplication.clipboard().setMimeData(data)
            names = " and ".join(file.name for file in files)
            self._window.notices.inform(f"Copied {names}: paste in a file manager.")
        elif self._way == "drag" and self._handle.pulled:
            drag = QDrag(self._handle)
            drag.setMimeData(data)
            drag.exec(Qt.DropAction.CopyAction)
        elif self._way == "drag":  # released since
            self._window.say_briefly("Rendered: drag it now")
