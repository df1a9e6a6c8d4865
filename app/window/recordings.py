"""What is played through the patch, recorded and written as files; what is not saved yet is kept."""

from __future__ import annotations

import time
from datetime import datetime
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QFileDialog, QMessageBox

from app.export.played import Played, recorded_files, write_recorded
from app.instrument.events import PatchTurned
from app.playing.keys import Keys
from app.presets.library import Library
from app.session.choices import Session
from app.shared.vocabulary import DIFFERENCE, PlayedSource
from app.views.background import Background
from app.views.instrument.patch_bar import PatchBar
from engine.presets import load_preset
from engine.result_file import WriteError

FILES = "WAV and MIDI (*.wav)"
WAIT_S = 30.0  # for files that are being written, when the window is closed


class Recordings(QObject):
    """Lives in the window's thread, as long as the window. The button of `bar` records, ends, saves and discards.

    A recording is kept until it is written or discarded; while one is, no other begins.
    """

    told = Signal(str)  # an error, for the user
    informed = Signal(str)  # what went well

    def __init__(self, session: Session, library: Library, keys: Keys, bar: PatchBar, parent: QObject) -> None:
        super().__init__(parent)
        self._session, self._library, self._keys, self._bar = session, library, keys, bar
        self._began_s, self._began = 0.0, datetime.now().astimezone()
        self._unsaved: list[Played] = []
        self._writers: list[Background] = []  # one for each recording
        bar.record_asked.connect(self.record)
        bar.recording_save_asked.connect(self.save)
        bar.recording_discard_asked.connect(self.discard)

    def record(self) -> None:
        """Begins to record; or ends it and asks for a file, as it does for a recording that is not saved yet."""
        if self._keys.recorder.recording:
            self._end()
        elif self._unsaved:
            self.save()
        else:
            self._keys.begin_recording()
            if not self._session.choices.plays_patch:
                self.informed.emit("Keys of a patch are recorded; plucks of a single string are not.")
            self._began_s, self._began = time.monotonic(), datetime.now().astimezone()

    def save(self) -> None:
        """Asks for a file for the latest recording. Without one, the recording is kept."""
        if not self._unsaved:
            return
        played = self._unsaved[-1]
        name = f"{played.patch.name}.wav"
        while name:
            name, _ = QFileDialog.getSaveFileName(self._bar, "Save what was played", name, FILES)
            if not name:
                return
            taken = [each for each in recorded_files(Path(name)) if each.exists() and each != Path(name)]
            if not taken:  # the dialog has asked for the name itself alone
                self.write(Path(name), played)
                return
            self.told.emit(f"{taken[0]} exists already; choose another name.")

    def discard(self) -> None:
        """Forgets the latest recording."""
        if self._unsaved:
            self._unsaved.pop()
            self._show_unsaved()

    def write(self, path: Path, played: Played) -> None:
        """Writes WAV and MIDI of one name in a thread; a recording that could not be written is kept."""
        if played in self._unsaved:
            self._unsaved.remove(played)
            self._show_unsaved()
        entry = self._library.find(played.patch.preset)
        if entry is None:
            self._take_back(played, f"The preset {played.patch.preset}, which plays the patch, was not found.")
            return
        for ended in [each for each in self._writers if not each.busy]:
            ended.close()
            self._writers.remove(ended)
        preset_file = entry.path
        writer = Background("performance-writer", self, expected=(ValueError, WriteError, OSError))
        writer.finished.connect(self.informed.emit)
        writer.failed.connect(lambda message, details: self._take_back(played, message.splitlines()[0]))
        self._writers.append(writer)
        writer.start(lambda job: write_recorded(path, played, load_preset(preset_file), lambda seconds: job.check()))

    def tick(self, now_s: float) -> None:
        """Shows how long it has been recording. `now_s`: of `time.monotonic`."""
        if self._keys.recorder.recording:
            self._bar.show_recording(now_s - self._began_s)

    def may_close(self) -> bool:
        """Whether the window may be closed; asks where that would lose what was played."""
        lost = []
        if self._unsaved or self._keys.recorder.recording:
            lost.append("What was played is not saved.")
        if self._writing:
            lost.append("The sound of a recording is still being written; its notes are in the MIDI file already.")
        if not lost:
            return True
        question = "Close the window, and lose it?"
        answer = QMessageBox.question(self._bar, "Recording not saved", " ".join([*lost, question]))
        if answer != QMessageBox.StandardButton.Yes:
            return False
        for writer in self._writers:
            writer.cancel()
        return True

    @property
    def _writing(self) -> bool:
        return any(writer.busy for writer in self._writers)

    def close(self) -> None:
        """Waits until files are written, WAIT_S at most; may be called again."""
        until_s = time.monotonic() + WAIT_S
        for writer in self._writers:
            writer.close(max(0.0, until_s - time.monotonic()), cancel=False)

    def _end(self) -> None:
        events = self._keys.recorder.end()
        self._bar.show_recording(None)
        patches = [each.event.patch for each in events if isinstance(each.event, PatchTurned)]
        patch = patches[0] if patches else self._session.choices.patch
        if not events or patch is None:
            self.told.emit("Nothing was played, so nothing was recorded.")
            return
        choices = self._session.choices
        heard = choices.source_heard
        source: PlayedSource = "truth" if heard == "truth" else "difference" if heard == DIFFERENCE else "model"
        self._unsaved.append(Played(patch, tuple(events), source, choices.difference_gain_db, self._began))
        self._show_unsaved()
        if choices.solo:
            self.informed.emit(f"The recording has all modes, although mode {choices.solo} is soloed.")
        self.save()

    def _take_back(self, played: Played, message: str) -> None:
        """What could not be written is kept."""
        self._unsaved.append(played)
        self._show_unsaved()
        self.told.emit(f"{message.rstrip('.')}. The recording is kept: save it by the button that records.")

    def _show_unsaved(self) -> None:
        self._bar.show_unsaved(len(self._unsaved))
