"""What is played through the patch is recorded; what is not saved yet is kept."""

from __future__ import annotations

import time
from datetime import datetime

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QMessageBox

from app.export.played import Played
from app.instrument.events import PatchTurned
from app.playing.keys import Keys
from app.session.choices import Session
from app.shared.vocabulary import DIFFERENCE, PlayedSource
from app.views.instrument.patch_bar import PatchBar


class Recordings(QObject):
    """Lives in the window's thread, as long as the window. The button of `bar` records, ends, saves and discards.

    A recording is kept until it is written or discarded; while one is, no other begins.
    """

    reported = Signal(str)  # an error, for the user
    informed = Signal(str)  # what went well
    save_asked = Signal()  # of the latest one
    unsaved_changed = Signal()

    def __init__(self, session: Session, keys: Keys, bar: PatchBar, parent: QObject) -> None:
        super().__init__(parent)
        self._session, self._keys, self._bar = session, keys, bar
        self._began_s, self._began = 0.0, datetime.now().astimezone()
        self._unsaved: list[Played] = []
        bar.record_asked.connect(self.record)
        bar.recording_save_asked.connect(self.save_asked)
        bar.recording_discard_asked.connect(self.discard)

    @property
    def latest(self) -> Played | None:
        """The latest one that is not saved."""
        return self._unsaved[-1] if self._unsaved else None

    def record(self) -> None:
        """Begins to record; or ends it and has it saved, as a recording that is not saved yet."""
        if self._keys.recorder.recording:
            self._end()
        elif self._unsaved:
            self.save_asked.emit()
        else:
            self._keys.begin_recording()
            if not self._session.choices.plays_patch:
                self.informed.emit("Keys of an instrument are recorded; plucks of a single string are not.")
            self._began_s, self._began = time.monotonic(), datetime.now().astimezone()

    def discard(self) -> None:
        """Forgets the latest recording."""
        if self._unsaved:
            self.forget(self._unsaved[-1])

    def forget(self, played: Played) -> None:
        """It is written, or not wanted."""
        if played in self._unsaved:
            self._unsaved.remove(played)
            self._show_unsaved()

    def tick(self, now_s: float) -> None:
        """Shows how long it has been recording. `now_s`: of `time.monotonic`."""
        if self._keys.recorder.recording:
            self._bar.show_recording(now_s - self._began_s)

    def may_close(self) -> bool:
        """Whether the window may be closed; asks where that would lose what was played."""
        if not self._unsaved and not self._keys.recorder.recording:
            return True
        question = "What was played is not saved. Quit without saving the recording?"
        answer = QMessageBox.question(self._bar, "Recording not saved", question)
        return answer == QMessageBox.StandardButton.Yes

    def _end(self) -> None:
        events = self._keys.recorder.end()
        self._bar.show_recording(None)
        patches = [each.event.patch for each in events if isinstance(each.event, PatchTurned)]
        patch = patches[0] if patches else self._session.choices.patch
        if not events or patch is None:
            self.informed.emit("Nothing was played, so nothing was recorded.")
            return
        choices = self._session.choices
        heard = choices.source_heard
        source: PlayedSource = "truth" if heard == "truth" else "difference" if heard == DIFFERENCE else "model"
        self._unsaved.append(Played(patch, tuple(events), source, choices.difference_gain_db, self._began))
        self._show_unsaved()
        if choices.solo:
            self.informed.emit(f"The recording has all modes, although mode {choices.solo} is soloed.")
        self.save_asked.emit()

    def _show_unsaved(self) -> None:
        self._bar.show_unsaved(len(self._unsaved))
        self.unsaved_changed.emit()
