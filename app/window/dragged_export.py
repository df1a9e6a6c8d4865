"""The chosen pluck, dragged out of the window as a WAV file; it is rendered when the drag begins.

The files lie in a temporary folder until the program ends, for another program may read them late. They are kept
for the next drag of the same choices: where the button is released before they are rendered, drag again.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QApplication

from app.export.choices import ExportChoices
from app.export.files import Source
from app.presets.library import PresetEntry
from app.session.choices import Choices, PluckedString
from app.session.listener import Listener
from app.shared.worker import Job
from app.views.background import Background
from app.views.controls.drag_button import DragButton
from app.views.dialogs.chosen_sound import export_chosen, suggested_name
from app.views.dialogs.export_pages import as_heard
from app.views.dialogs.job_dialog import EXPECTED

_SOUND = {*PluckedString.model_fields, *Listener.model_fields} - {"solo"}


class DraggedExport(QObject):
    """Renders with the settings that the export dialog had last.

    Args:
        chosen: the presets, the present choices, and those of the export dialog.
    """

    told = Signal(str)  # an error, for the user

    def __init__(
        self, button: DragButton, chosen: Callable[[], tuple[Sequence[PresetEntry], Choices, ExportChoices]]
    ) -> None:
        super().__init__(button)
        self._button, self._chosen = button, chosen
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._rendered = 0
        self._rendering = Background("dragged-export", self, expected=EXPECTED)
        self._rendering.finished.connect(self._carry)
        self._rendering.failed.connect(self._failed)
        self._kept: tuple[object, list[Path]] = (None, [])  # what was rendered last, and its files
        button.drag_began.connect(self._begin)
        button.drag_ended.connect(self._end)

    def close(self) -> None:
        """Cancels the rendering, and removes all files; may be called again."""
        self._end()
        self._rendering.close(None)
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    def _begin(self) -> None:
        self._end()
        entries, choices, export = self._chosen()
        if all(entry.name != choices.preset for entry in entries):
            self.told.emit("There is no preset to export: choose one first.")
            return
        choices, export = as_heard(entries, choices, export)
        preset = next(entry for entry in entries if entry.name == choices.preset)
        sources: tuple[Source, ...] = ("model", "truth") if export.source == "files" else (export.source,)
        if choices.stereo and sources == ("both",):  # left and right are taken
            sources = ("model",)
        sound, form = choices.model_dump(include=_SOUND), export.model_dump(exclude={"folder", "batch"})
        wish = (preset, sources, sound, form)
        if wish == self._kept[0] and all(path.is_file() for path in self._kept[1]):
            self._button.carry(self._kept[1])
            return
        try:
            paths = self._paths(preset, choices, export, sources)
        except OSError as error:
            where, why = tempfile.gettempdir(), error.strerror
            self.told.emit(f"{where}: no folder can be created there ({why}); free some space.")
            return

        def work(job: Job) -> tuple[object, list[Path]]:
            return wish, [each.path for each in export_chosen(preset, choices, export, paths, job.progress)]

        QApplication.setOverrideCursor(Qt.CursorShape.WaitCursor)
        self._rendering.start(work)

    def _paths(
        self, preset: PresetEntry, choices: Choices, export: ExportChoices, sources: tuple[Source, ...]
    ) -> dict[Source, Path]:
        """In a folder of its own, so that no earlier file of this name is replaced while another program reads it."""
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="learned-strings-", ignore_cleanup_errors=True)
        self._rendered += 1
        folder = Path(self._folder.name) / str(self._rendered)
        folder.mkdir()
        return {source: folder / suggested_name(preset, choices, export.rate_hz, source) for source in sources}

    def _carry(self, rendered: tuple[object, list[Path]]) -> None:
        QApplication.restoreOverrideCursor()
        self._kept = rendered
        self._button.carry(self._kept[1])

    def _failed(self, message: str) -> None:
        QApplication.restoreOverrideCursor()
        self.told.emit(message)

    def _end(self) -> None:
        """The button was released: cancels the rendering."""
        if self._rendering.busy:
            self._rendering.cancel()
            QApplication.restoreOverrideCursor()
