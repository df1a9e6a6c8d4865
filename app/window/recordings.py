"""Recordings of what is played through the patch. Unsaved ones are kept, in memory and on disk."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from datetime import datetime

from PySide6.QtCore import QObject, Signal

from app.export.journal import Journal, left_journals, recordings_folder
from app.export.played import Played
from app.instrument.events import NoteOn, PatchTurned
from app.playing.keys import Keys
from app.playing.recorder import EventRecorder
from app.session.choices import Choices
from app.shared.thread_priority import Rank, lower_priority
from app.shared.vocabulary import DIFFERENCE, PlayedSource
from app.stage.session import Session
from app.views.background import Background
from app.views.dialogs.question import ask
from app.window.main_window import MainWindow
from engine.plain_text import duration, one_line

WRITE_EVERY_S = 0.25  # to disk
LONGEST_NAME = 60  # characters of an instrument
RECOVER = "Recover"
LATER = "Later"
DISCARD = "Discard"


class Journaling(QObject):
    """The writing of a recording to disk while it is made, in a thread: a crash loses a fraction of a second.

    Methods belong to the window's thread. Where the disk fails, the recording continues in memory alone.

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


class Recordings(QObject):
    """Recordings, which live in the window's thread, as long as the window.

    The button of the instrument's bar records, ends, saves and discards.

    A recording is kept until it is written or discarded; while one is, no other begins. Its journal on disk is kept
    as long, also past the end of the process, and `offer_left` finds it.
    """

    save_asked = Signal()  # of the latest one
    unsaved_changed = Signal()

    def __init__(self, window: MainWindow, session: Session, keys: Keys) -> None:
        super().__init__(window)
        self._session = session
        self._keys = keys
        self._notices = window.notices
        self._bar = bar = window.instrument.bar
        self._began_s, self._began = 0.0, datetime.now().astimezone()
        self._unsaved: dict[Played, Journal | None] = {}  # in their order
        self._journaling = Journaling(keys.recorder, self)
        self._journaling.failed.connect(self._notices.report)
        self._reading = Background("journals", self)
        self._reading.finished.connect(lambda read: self._ask_about(*read))
        self._reading.failed.connect(self._notices.report)
        session.changed.connect(self._choices_changed)
        bar.record_asked.connect(self.record)
        bar.recording_save_asked.connect(self.save_asked)
        bar.recording_discard_asked.connect(self.discard)

    @property
    def latest(self) -> Played | None:
        """The latest one that is not saved."""
        return next(reversed(self._unsaved), None)

    @property
    def unsaved(self) -> bool:
        """Return True if anything was played that is not saved, or is being recorded."""
        return bool(self._unsaved) or self._keys.recorder.recording

    def record(self) -> None:
        """Begin to record; or end it and have it saved, as a recording that is not saved yet."""
        if self._keys.recorder.recording:
            self.end()
            if self._unsaved:
                self.save_asked.emit()
        elif self._unsaved:
            self.save_asked.emit()
        else:
            self._keys.begin_recording()
            if not self._session.choices.plays_patch:
                self._notices.inform("Keys of an instrument are recorded; plucks of a single string are not.")
            self._began_s, self._began = time.monotonic(), datetime.now().astimezone()
            self._journaling.begin(self._began)
            self._choices_changed(frozenset())

    def discard(self) -> None:
        """Forget the latest recording."""
        if (latest := self.latest) is not None:
            self.forget(latest)

    def forget(self, played: Played) -> None:
        """Forget a recording that is written, or not wanted."""
        if played in self._unsaved:
            journal = self._unsaved.pop(played)
            if journal is not None:
                journal.delete()
            self._show_unsaved()

    def forget_all(self) -> None:
        """Forget all that is not saved, and what is being recorded."""
        self.end()
        for played in list(self._unsaved):
            self.forget(played)

    def close(self) -> None:
        """Leave what is not saved to the next start; may be called again."""
        self._reading.close()
        self.end()
        for journal in self._unsaved.values():
            if journal is not None:
                journal.close()

    def offer_left(self) -> None:
        """Read what an earlier run has left, in the background, then ask whether to recover or discard it."""
        self._reading.start(lambda job: _read_left(job.check))

    def _ask_about(self, journals: dict[Played, Journal], problems: list[str]) -> None:
        """Ask about journals that were left; `problems`: why others cannot be read."""
        for problem in problems:
            self._notices.report(problem)
        if not journals:
            return
        if self._keys.recorder.recording:  # no question comes between a musician and the keys
            self._notices.inform("An earlier recording is not saved yet; the next start offers it.")
            answer = LATER
        else:
            lines = "\n".join(_words(played) for played in journals)
            were = "These recordings were" if len(journals) > 1 else "This recording was"
            question = f"{were} not saved when the app ended.\n\n{lines}"
            answer = ask(self._bar, "Recover what was played?", question, LATER, DISCARD, RECOVER)
        for played, journal in journals.items():
            if answer == RECOVER:
                self._unsaved[played] = journal
            elif answer == DISCARD:
                journal.delete()
            else:
                journal.close()
        if answer == RECOVER:
            self._show_unsaved()
            self.save_asked.emit()

    def tick(self, now_s: float) -> None:
        """Show how long it has been recording. `now_s`: of `time.monotonic`."""
        if self._keys.recorder.recording:
            self._bar.show_recording(now_s - self._began_s)

    def end(self) -> None:
        """End the recording that is being made, if any; it is kept, and not saved yet."""
        if not self._keys.recorder.recording:
            return
        events = self._keys.recorder.end()
        journal = self._journaling.end()
        self._bar.show_recording(None)
        patches = [timed_event.event.patch for timed_event in events if isinstance(timed_event.event, PatchTurned)]
        patch = patches[0] if patches else self._session.choices.patch
        if not events or patch is None:
            if journal is not None:
                journal.delete()
            self._notices.inform("Nothing was played, so nothing was recorded.")
            return
        choices = self._session.choices
        self._unsaved[Played(patch, tuple(events), *_heard(choices), self._began)] = journal
        self._show_unsaved()
        if choices.solo:
            self._notices.inform(f"The recording has all modes, although mode {choices.solo} is soloed.")

    def _choices_changed(self, _: frozenset[str]) -> None:
        self._journaling.hear(*_heard(self._session.choices))

    def _show_unsaved(self) -> None:
        self._bar.show_unsaved(len(self._unsaved))
        self.unsaved_changed.emit()


def _read_left(check: Callable[[], None]) -> tuple[dict[Played, Journal], list[str]]:
    """The recordings that an earlier run has left, and why others cannot be read. `check`: see `Journal.read`."""
    journals: dict[Played, Journal] = {}
    problems: list[str] = []
    for journal in left_journals(recordings_folder()):
        try:
            played = journal.read(check)
        except (OSError, ValueError) as error:
            problems.append(f"{one_line(str(error))}; it cannot be recovered, and stays where it is.")
            journal.close()
            continue
        if played is None:
            journal.delete()
        else:
            journals[played] = journal
    return journals, problems


def played_source(choices: Choices) -> PlayedSource:
    """The source that is heard, as files name it; of another preset the model plays keys."""
    source = choices.source_heard
    return "truth" if source == "truth" else "difference" if source == DIFFERENCE else "model"


def _heard(choices: Choices) -> tuple[PlayedSource, float]:
    """The source that is heard, and the gain of the difference."""
    return played_source(choices), choices.difference_gain_db


def _words(played: Played) -> str:
    """A recording in a line: when, through what, how long, how many notes."""
    events = [timed_event.event for timed_event in played.events]
    notes = sum(isinstance(event, NoteOn) and event.velocity > 0 for event in events)
    when = "" if played.recorded is None else f"{played.recorded.astimezone():%Y-%m-%d %H:%M}, "
    name = one_line(played.patch.name, LONGEST_NAME)
    return f"{when}{name}: {duration(played.events[-1].time_s)}, {notes} note{'' if notes == 1 else 's'}"
