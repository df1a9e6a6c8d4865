"""Exports: what can be exported now, its dialog, and files dragged out of the window."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QApplication, QWidget

from app.export.choices import ExportChoices
from app.export.job import EXPECTED
from app.export.note import HeardNote, Note, NoteExport
from app.export.played import PlayedExport
from app.export.sampled.choices import SampledChoices
from app.export.sound import Through
from app.presets.library import Library
from app.presets.words import shape_word
from app.session.choices import Choices, Session
from app.session.slots import other_preset
from app.shared.vocabulary import DIFFERENCE, Source
from app.shared.worker import Job
from app.views.background import Background
from app.views.controls.drag_button import DragButton
from app.views.dialogs.export_dialog import ExportDialog
from app.views.dialogs.export_pages import PAGES, HeardInstrument, HeardPerformance, Kind
from app.window.recordings import Recordings

PLUCK_FIELDS = {"preset", "string", "position", "amplitude_mm", "shape", "width", "patch"}
HEARD_FIELDS = {"listen", "listen_right", "stereo", "pickup", "solo", "a", "b", "heard", "difference_gain_db"}


class Exports(QObject):
    """Lives as long as the window; `told` has notices for the user.

    Args:
        through: what the present instrument adds to a string of `Choices`; None: nothing.
        button: from which files are dragged.
    """

    told = Signal(str)

    def __init__(
        self,
        session: Session,
        library: Library,
        recordings: Recordings,
        through: Callable[[Choices], Through | None],
        choices: tuple[ExportChoices, SampledChoices],
        button: DragButton,
        window: QWidget,
    ) -> None:
        super().__init__(window)
        self._session, self._library, self._window = session, library, window
        self._recordings, self._through = recordings, through
        self._choices = choices
        self.dialog: ExportDialog | None = None
        self.dragged = DraggedExport(button, lambda: (self._heard_note(), self.choices[0]), self)
        self.dragged.told.connect(self.told)
        recordings.save_asked.connect(lambda: self.open("performance"))
        recordings.unsaved_changed.connect(self.refresh)

    @property
    def choices(self) -> tuple[ExportChoices, SampledChoices]:
        """The dialog's choices, to be saved."""
        return self._choices if self.dialog is None else (self.dialog.choices(), self.dialog.sampled_choices())

    def open(self, kind: Kind) -> None:
        """Opens the dialog at a page, or brings it to the front."""
        subjects = self._subjects()
        if subjects[kind] is None:
            self.told.emit(PAGES[kind].missing)
            return
        if self.dialog is None:
            self.dialog = ExportDialog(*self._choices, self._window)
            self.dialog.finished.connect(self._closed)
            self.dialog.exported.connect(self._exported)
        self.dialog.show_subjects(subjects)
        self.dialog.open_at(kind)

    def choices_changed(self, names: frozenset[str]) -> None:
        if names & (PLUCK_FIELDS | HEARD_FIELDS):
            self.refresh()

    def refresh(self) -> None:
        """What can be exported may have changed."""
        if self.dialog is not None:
            self.dialog.show_subjects(self._subjects())

    def close(self) -> None:
        """Ends an export that has begun; what is whole is kept. May be called again."""
        self.dragged.close()
        if self.dialog is not None:
            self.dialog.accept()

    def _heard_note(self) -> HeardNote | None:
        choices = self._session.choices
        return heard_note(choices, self._library, self._through(choices))

    def _subjects(self) -> dict[Kind, Any]:
        """By kind, what can be exported now; None: nothing."""
        played, patch = self._recordings.latest, self._session.choices.patch
        preset = None if played is None else self._library.find(played.patch.preset)
        player = None if patch is None else self._library.find(patch.preset)
        return {
            "note": self._heard_note(),
            "performance": played and HeardPerformance(played, None if preset is None else preset.path),
            "sampler": None if patch is None or player is None else HeardInstrument(patch, player),
        }

    def _exported(self, job: object) -> None:
        if isinstance(job, PlayedExport):
            self._recordings.forget(job.played)

    def _closed(self) -> None:
        assert self.dialog is not None
        self._choices = self.choices
        self.dialog.deleteLater()
        self.dialog = None


def heard_note(choices: Choices, library: Library, through: Through | None) -> HeardNote | None:
    """The chosen pluck as it is heard, of another preset where that is heard; None: there is no preset."""
    source, another = choices.source_heard, library.find(other_preset(choices.source_heard) or "")
    if another is not None:
        choices = choices.model_copy(update={"preset": another.name, "string": None})
    entry = library.find(choices.preset)
    if entry is None:
        return None
    note = Note(
        entry.path,
        entry.info.rate_hz,
        choices.pluck,
        choices.listen,
        choices.listen_right if choices.stereo else None,
        choices.pickup,
        None if choices.string is None else choices.string.parameters,
        through,
    )
    saved: Source = "truth" if source == "truth" else "difference" if source == DIFFERENCE else "model"
    return HeardNote(note, saved, another is not None, choices.difference_gain_db, _words(entry.title, choices))


class DraggedExport(QObject):
    """The chosen note, dragged out of the window as WAV files, which are rendered when the drag begins.

    They lie in a temporary folder until the program ends, for another program may read them late. They are kept for
    the next drag of the same choices: where the button is released before they are rendered, drag again.
    """

    told = Signal(str)  # an error, for the user

    def __init__(
        self, button: DragButton, chosen: Callable[[], tuple[HeardNote | None, ExportChoices]], parent: QObject
    ) -> None:
        super().__init__(parent)
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
        heard, choices = self._chosen()
        if heard is None:
            self.told.emit(PAGES["note"].missing)
            return
        note, source = heard.note, heard.chosen(choices.source)
        two = source == "files" or (source == "both" and note.in_stereo(choices.alone))
        sources: tuple[Source, ...] = ("model", "truth") if two else (source,)  # type: ignore[assignment]
        choices = choices.model_copy(update={"difference_gain_db": heard.difference_gain_db, "folder": ""})
        wish = (note, sources, choices)
        if wish == self._kept[0] and all(path.is_file() for path in self._kept[1]):
            self._button.carry(self._kept[1])
            return
        try:
            folder = self._new_folder()
        except OSError as error:
            where, why = tempfile.gettempdir(), error.strerror
            self.told.emit(f"{where}: no folder can be created there ({why}); free some space.")
            return
        paths = {source: folder / note.file_name(choices.rate_hz, source) for source in sources}

        def work(job: Job) -> tuple[object, list[Path]]:
            NoteExport(note, paths, choices).run(job.progress)
            return wish, list(paths.values())

        QApplication.setOverrideCursor(Qt.CursorShape.WaitCursor)
        self._rendering.start(work)

    def _new_folder(self) -> Path:
        """One for each drag, so that no earlier file of a name is replaced while another program reads it."""
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="learned-strings-", ignore_cleanup_errors=True)
        self._rendered += 1
        folder = Path(self._folder.name) / str(self._rendered)
        folder.mkdir()
        return folder

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


def _words(title: str, choices: Choices) -> str:
    """The pluck and where it is heard."""
    width = "" if choices.shape == "triangular" else f" {choices.width:.3f} wide"
    string = f", a string of {choices.string.first_hz:.1f} Hz" if choices.string else ""
    pluck = f"{shape_word(choices.shape)}{width}, at {choices.position:.2f}, {choices.amplitude_mm:g} mm"
    heard = f"heard at {choices.listen:.2f}"
    if choices.stereo:
        heard += f" (left) and {choices.listen_right:.2f} (right)"
    velocity = ", velocity" if choices.pickup == "velocity" else ""
    modes = f". All modes, although mode {choices.solo} is soloed" if choices.solo else ""
    return f"{title}{string}: {pluck}, {heard}{velocity}{modes}"
