"""Exports: what can be exported now, and its dialog, which does not block the window."""

from __future__ import annotations

import math
from typing import Any

from PySide6.QtCore import QObject, Signal

from app.export.compared import ComparedModels
from app.export.job import ExportJob
from app.export.note import HeardNote, musical_name, struck_name
from app.export.played import PlayedExport
from app.export.takes import RecordedTake
from app.instruments.instrument import Instrument
from app.playing.keyboard import PluckRange
from app.presets.library import Library, PresetEntry
from app.rendering.note_sound import Struck
from app.session.choices import Choices
from app.session.monitor import Monitor
from app.session.slots import other_preset, sound_of
from app.stage.session import Session
from app.views.dialogs.export_dialog import ExportDialog
from app.views.dialogs.export_pages import PAGES, HeardInstrument, HeardPerformance, Kind, Remembered
from app.window.main_window import MainWindow
from app.window.recordings import Recordings, played_source

PLUCK_FIELDS = {"preset", "string", "pluck", "instrument"}
HEARD_FIELDS = {"ear", *Monitor.model_fields} - {"level_match"}


class Exports(QObject):
    """The exports, which live as long as the window.

    A subject is what a page of the dialog exports: a note, compared models, a recording, or an instrument.
    """

    ended = Signal(bool)  # True: an export was written; False: it was not, or the dialog was closed

    def __init__(
        self,
        window: MainWindow,
        session: Session,
        library: Library,
        recordings: Recordings,
        choices: Remembered,
    ) -> None:
        super().__init__(window)
        self._session = session
        self._library = library
        self._window = window
        self._recordings = recordings
        self._choices = choices
        self.models: ComparedModels | None = None  # that were asked for last
        self.dialog: ExportDialog | None = None
        recordings.save_asked.connect(lambda: self.open("performance"))
        recordings.unsaved_changed.connect(self.refresh)

    @property
    def choices(self) -> Remembered:
        """The dialog's choices, to be saved."""
        return self._choices if self.dialog is None else self.dialog.choices()

    def open(self, kind: Kind) -> None:
        """Open the dialog at a page, or bring it to the front."""
        subjects = self.subjects
        if subjects[kind] is None:
            self._window.notices.report(PAGES[kind].missing)
            return
        if self.dialog is None:
            self.dialog = ExportDialog(self._choices, self._window.places, self._window)
            self.dialog.finished.connect(self._end_dialog)
            self.dialog.exported.connect(self._exported)
            self.dialog.ended.connect(self.ended)
        self.dialog.show_subjects(subjects)
        self.dialog.open_at(kind)

    def choices_changed(self, names: frozenset[str]) -> None:
        if names & (PLUCK_FIELDS | HEARD_FIELDS):
            self.refresh()

    def refresh(self) -> None:
        """Renew the subjects, as what can be exported may have changed."""
        if self.dialog is not None:
            self.dialog.show_subjects(self.subjects)

    @property
    def busy(self) -> bool:
        """Return True if an export is under way."""
        return self.dialog is not None and self.dialog.job is not None

    def close(self) -> None:
        """End an export that has begun; what is whole is kept. May be called again."""
        if self.dialog is not None:
            self.dialog.accept()

    def dismiss(self) -> bool:
        """Close the dialog with its result: Escape in the window, which has the keyboard since an export began."""
        if self.dialog is None or self.busy:
            return False
        self.dialog.accept()
        return True

    @property
    def subjects(self) -> dict[Kind, Any]:
        """The subjects that can be exported now, by kind; None: nothing."""
        choices, take = self._session.choices, self._recordings.offered
        instrument = choices.instrument
        player = None if instrument is None else self._library.find(instrument.preset)
        heard = None if instrument is None or player is None else HeardInstrument(instrument, player)
        return {
            "note": heard_note(choices, self._library, self._session.stage.struck),
            "models": self.models,
            "performance": None if take is None else self._performance(take),
            "sampler": heard,
            "plugin": heard,
        }

    def _performance(self, take: RecordedTake) -> HeardPerformance:
        preset = self._library.find(take.played.instrument.preset)
        return HeardPerformance(take.played, None if preset is None else preset.path, take.name)

    def _exported(self, job: ExportJob) -> None:
        self._window.notices.inform(f"Saved {job.file}.", file=job.file)
        if isinstance(job, PlayedExport):
            self._recordings.keep(job)

    def _end_dialog(self) -> None:
        assert self.dialog is not None
        self._choices = self.choices
        self.dialog.deleteLater()
        self.dialog = None
        self.ended.emit(False)


def heard_note(choices: Choices, library: Library, struck: Struck | None = None) -> HeardNote | None:
    """The chosen pluck as it is heard, of another preset where that is heard; or an instrument's key.

    None: there is no preset.

    Args:
        struck: the instrument's key; None: the string is plucked alone.
    """
    source, another = choices.source_heard, None
    if struck is None and (another := library.find(other_preset(source) or "")) is not None:
        choices = choices.changed({"preset": another.name})
    entry = library.find(choices.preset)
    if entry is None:
        return None
    sound = sound_of(choices, entry.path, struck)
    return HeardNote(
        sound,
        played_source(choices),
        another is not None,
        choices.difference_gain_db,
        sound.alone.words(entry.title),
        _pluck_name(choices, entry) if struck is None else struck_name(struck),
        entry.info.rate_hz,
    )


def _pluck_name(choices: Choices, entry: PresetEntry) -> str:
    """The name for a file: of the instrument whose key was played, else of the preset."""
    string = choices.string or entry.info.string
    title, amplitudes_mm = entry.info.title, PluckRange.of(entry.info).amplitude_mm
    if isinstance(choices.played, Instrument):
        pluck = choices.played.pluck
        title, amplitudes_mm = choices.played.name, (pluck.softest_mm, pluck.hardest_mm)
    return musical_name(title, string.undamped_frequency(1) / math.tau, *amplitudes_mm, choices.pluck.amplitude_mm)
