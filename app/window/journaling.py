"""The writing of recordings to disk while they are made, in a thread of its own.

A crash loses a fraction of a second.
"""

from __future__ import annotations

import threading
from datetime import datetime

from PySide6.QtCore import QObject, Signal

from app.export.journal import Journal, recordings_folder
from app.playing.recorder import EventRecorder
from app.shared.thread_priority import Rank, lower_priority
from app.shared.vocabulary import PlayedSource

WRITE_EVERY_S = 0.25


class Journaling(QObject):
    """Methods belong to the window's thread. Where the disk fails, the recording continues in memory alone.

    Args:
        recorder: whose events are written.
    """

    failed = Signal(str)  # why the recording is in memory alone from now on

    def __init__(self, recorder: EventRecorder, parent: QObject) -> None:
        super().__init__(parent)
        self._recorder = recorder
        self._journal: Journal | None = None
        self._heard: tuple[PlayedSource, float] = ("model", 0.0)
        self._written: tuple[PlayedSource, float] = self._heard
        self._broken = False
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def begin(self, recorded: datetime) -> None:
        """A recording has begun."""
        self._journal, self._broken = None, False
        self._written = ("model", 0.0)
        self._stop.clear()
        try:
            self._journal = Journal.begun(recordings_folder(), recorded)
        except OSError as error:
            self._fail(error)
            return
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)
        self._thread.start()

    def hear(self, source: PlayedSource, difference_gain_db: float) -> None:
        """The source that is heard from now on."""
        self._heard = source, difference_gain_db

    def end(self) -> Journal | None:
        """End the journal, with all of the recording, and return it; None: it could not be begun."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
        journal = self._journal
        self._journal = None
        self._thread = None
        if journal is not None and not self._broken:
            try:
                journal.end(self._recorder.ended_s)
            except OSError as error:
                self._fail(error)
        return journal

    def _run(self) -> None:
        lower_priority(Rank.BACKGROUND)
        while not self._broken:
            stopped = self._stop.wait(WRITE_EVERY_S)
            self._write()
            if stopped:
                return

    def _write(self) -> None:
        """Append what is new. After a fault nothing more: what follows would stand behind a torn line."""
        journal, source_and_gain = self._journal, self._heard
        assert journal is not None
        try:
            journal.write(self._recorder.fetch())
            if source_and_gain != self._written:
                journal.hear(*source_and_gain)
                self._written = source_and_gain
        except OSError as error:
            self._broken = True
            self._fail(error)

    def _fail(self, error: OSError) -> None:
        place = error.filename or recordings_folder()
        self.failed.emit(
            f"The recording cannot be written to disk while you play ({place}: {error.strerror or error}); "
            "a crash would lose it. Save it soon."
        )
