"""Recordings of what is played through the instrument: a session's takes; unsaved ones are kept on disk."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from datetime import datetime
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Signal

from app.export.job import EXPECTED
from app.export.journal import Journal, left_journals, recordings_folder
from app.export.played import Played, PlayedExport
from app.export.takes import RecordedTake, free_path
from app.export.wav import WavSettings
from app.player.events import InstrumentTurned, Meter, NoteOn
from app.playing.metronome import Metronome
from app.playing.notes import Notes
from app.playing.recorder import EventRecorder
from app.presets.library import Library
from app.session.choices import Choices
from app.shared.thread_priority import Rank, lower_priority
from app.shared.vocabulary import DIFFERENCE, PlayedSource
from app.stage.session import Session
from app.views.background import Background
from app.views.dialogs.question import ask, ask_text
from app.views.file_manager import reveal
from app.window.main_window import MainWindow
from engine.plain_text import duration, one_line
from engine.whole_file import explain

WRITE_EVERY_S = 0.25  # to disk
LONGEST_NAME = 60  # characters of an instrument or a take
RECOVER = "Recover"
LATER = "Later"
DISCARD = "Discard"
KEEP, DELETE = "Keep", "Delete"


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
        self._journal: Journal | None = None  # None: nothing is recorded, or it could not be begun
        self._heard: tuple[PlayedSource, float] = ("model", 0.0)  # the source now, and gain of the difference in dB
        self._written: tuple[PlayedSource, float] = self._heard  # as the journal last had it
        self._broken = False  # writing failed: no more is written
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def begin(self, recorded: datetime, meter: Meter | None) -> None:
        """Begin the journal of a recording, and the thread that writes it.

        Args:
            recorded: when it begins.
            meter: tempo and beats of the metronome; None: it is not counted.
        """
        self._journal, self._broken = None, False
        self._written = ("model", 0.0)
        self._stop.clear()
        try:
            self._journal = Journal.begun(recordings_folder(), recorded, meter)
        except OSError as error:
            self._fail(error)
            return
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)
        self._thread.start()

    def hear(self, source: PlayedSource, difference_gain_db: float) -> None:
        """Note the source that is heard from now on, and the gain of the difference in dB; the thread writes it."""
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
        """Write what is new every WRITE_EVERY_S, and once more at the end; the journal's thread runs this."""
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
    """The takes of this session, which live in the window's thread, as long as the window.

    The button of the instrument's bar records and ends; the menu beside it has all takes. The first that is saved
    chooses the place, where later ones are written as soon as they end. Until it is written, a take is kept in memory
    and in its journal on disk, which `offer_left` finds after the end of the process.
    """

    save_asked = Signal()  # of the take that is offered: its place is to be chosen
    play_asked = Signal(object)  # a RecordedTake
    unsaved_changed = Signal()
    written = Signal(bool)  # a take where the others are, well or not

    def __init__(self, window: MainWindow, session: Session, notes: Notes, library: Library) -> None:
        super().__init__(window)
        self._session = session
        self._keys = notes.keys
        self._library = library
        self._notices = window.notices
        self._bar = bar = window.instrument.bar
        self._began_s, self._began = 0.0, datetime.now().astimezone()  # of its first beat or start; as a date
        self._metronome = Metronome(notes.sound)
        self._meter: Meter | None = None  # of the recording under way; None: it is not counted
        self._takes: list[RecordedTake] = []  # of this session, the latest last
        self._asked: RecordedTake | None = None  # for the export dialog
        self._place: tuple[Path, WavSettings] | None = None  # of the take that was saved last, its sound and format
        self._journaling = Journaling(self._keys.recorder, self)
        self._journaling.failed.connect(self._notices.report)
        self._reading = Background("journals", self)
        self._reading.finished.connect(lambda read: self._ask_about(*read))
        self._reading.failed.connect(self._notices.report)
        self._writing = Background("takes", self, expected=EXPECTED)
        self._writing.finished.connect(lambda written: self._end_writing(*written))
        self._writing.failed.connect(self._fail_to_write)
        session.changed.connect(self._choices_changed)
        bar.record_asked.connect(self.record)

    @property
    def _unsaved(self) -> list[RecordedTake]:
        return [take for take in self._takes if not take.files]

    @property
    def offered(self) -> RecordedTake | None:
        """The take for the export dialog: the one that was asked for, or the last."""
        return self._asked if self._asked in self._takes else next(reversed(self._takes), None)

    @property
    def unsaved(self) -> bool:
        """Return True if anything was played that is not saved, or is being recorded."""
        return bool(self._unsaved) or self._keys.recorder.recording

    def record(self) -> None:
        """Begin to record, after the count-in; or end it and have it saved, as a take that is not saved yet."""
        if self._keys.recorder.recording:
            self.end()
            self.save()
            return
        if not self._session.choices.plays_instrument:
            self._notices.inform("Keys of an instrument are recorded; plucks of a single string are not.")
        meter = self._bar.takes.meter
        self._meter = meter if meter.metronome or meter.count_in_bars else None
        beat_s = self._metronome.begin(meter) if self._meter else None
        self._keys.begin_recording(beat_s)
        self._began_s, self._began = beat_s or time.monotonic(), datetime.now().astimezone()
        self._journaling.begin(self._began, self._meter)
        self._choices_changed(frozenset())

    def save(self) -> None:
        """Write the latest that is not saved where others were saved; ask for a place where none was."""
        if not self._unsaved or self._writing.busy:
            return
        take = self._unsaved[-1]
        entry = self._library.find(take.played.instrument.preset)
        if self._place is None or entry is None:
            self._export(take)
            return
        before, settings = self._place
        path = free_path(before.with_name(f"{take.name}{before.suffix}"))
        job = PlayedExport(take.played, entry.path, path, settings)
        self._writing.start(lambda work: (job, job.run(work.progress)))
        self._show_takes()

    def keep(self, job: PlayedExport) -> None:
        """Take note of an export: the place of later takes, and the files of one that was not saved."""
        for take in self._takes:
            if take.played is job.played and (not take.files or job.file in take.files):
                take.save_to(job.file)
                self._place = job.file, job.settings
        self._show_takes()

    def _end_writing(self, job: PlayedExport, words: str) -> None:
        self.keep(job)
        self._notices.inform(words, file=job.file)
        self.save()  # one that ended meanwhile
        self.written.emit(True)

    def _fail_to_write(self, words: str) -> None:
        self._place = None
        self._show_takes()
        self._notices.report(f"{words} The take is kept: save it elsewhere in the menu beside Record.")
        self.written.emit(False)

    def _export(self, take: RecordedTake) -> None:
        self._asked = take
        self.save_asked.emit()

    def _delete(self, take: RecordedTake) -> None:
        files = " and ".join(file.name for file in take.own_files)
        question = f"{files} will be deleted." if files else f"{take.name} has no file, and will be lost."
        if ask(self._bar, "Delete the take?", question, KEEP, DELETE) == DELETE:
            take.delete()
            self._takes.remove(take)

    def forget_all(self) -> None:
        """Forget all that is not saved, and what is being recorded."""
        self.end()
        self._writing.cancel()
        for take in self._takes:
            take.forget_journal()
        self._takes = [take for take in self._takes if take.files]
        self._show_takes()

    def close(self) -> None:
        """Leave what is not saved to the next start; may be called again."""
        self._reading.close()
        self.end()
        self._writing.close()
        for take in self._takes:
            if take.journal is not None:
                take.journal.close()

    def offer_left(self) -> None:
        """Read what an earlier run has left, in the background, then ask whether to recover or discard it."""
        self._reading.start(lambda job: _read_left(job.check))

    def _ask_about(self, journals: dict[Played, Journal], problems: list[str]) -> None:
        """Ask whether to recover, discard or leave the recordings that an earlier run did not save.

        Args:
            journals: by recording; each is added to the takes, deleted, or closed until the next start.
            problems: why others cannot be read, to be reported.
        """
        for problem in problems:
            self._notices.report(problem)
        if not journals:
            return
        if self._keys.recorder.recording:  # no question comes between a musician and the keys
            self._notices.inform("An earlier recording is not saved yet; the next start offers it.")
            answer = LATER
        else:
            lines = "\n".join(_words(played, played.instrument.name) for played in journals)
            were = "These recordings were" if len(journals) > 1 else "This recording was"
            question = f"{were} not saved when the app ended.\n\n{lines}"
            answer = ask(self._bar, "Recover what was played?", question, LATER, DISCARD, RECOVER)
        for played, journal in journals.items():
            if answer == RECOVER:
                self._add(played, journal)
            elif answer == DISCARD:
                journal.delete()
            else:
                journal.close()
        if answer == RECOVER:
            self.save()

    def tick(self, now_s: float) -> None:
        """Continue with the clicks, and show how long it has been recording. `now_s`: of `time.monotonic`."""
        self._metronome.look()
        if self._keys.recorder.recording:
            self._bar.show_recording(now_s - self._began_s)

    def end(self) -> None:
        """End the recording that is being made, if any; it is kept, and not saved yet."""
        if not self._keys.recorder.recording:
            return
        self._metronome.end()
        events = self._keys.recorder.end()
        journal = self._journaling.end()
        self._bar.show_recording(None)
        turned = [entry.event for entry in events if isinstance(entry.event, InstrumentTurned)]
        instrument = turned[0].instrument if turned else self._session.choices.instrument
        if not events or instrument is None:
            if journal is not None:
                journal.delete()
            self._notices.inform("Nothing was played, so nothing was recorded.")
            return
        choices = self._session.choices
        self._add(Played(instrument, tuple(events), *_heard(choices), self._began, self._meter), journal)
        if choices.solo:
            self._notices.inform(f"The recording has all modes, although mode {choices.solo} is soloed.")

    def _choices_changed(self, _: frozenset[str]) -> None:
        self._journaling.hear(*_heard(self._session.choices))

    def _add(self, played: Played, journal: Journal | None) -> None:
        self._asked = RecordedTake(played, journal, played.instrument.name)
        self._takes.append(self._asked)
        self._show_takes()

    def _show_takes(self) -> None:
        """List the takes, the latest first."""
        rows = []
        for take in reversed(self._takes):
            state = "" if take.files else ", not saved"
            deeds = {words: partial(self._do, deed) for words, deed in self._deeds(take).items()}
            rows.append((f"{_words(take.played, take.name)}{state}", deeds))
        self._bar.takes.show_takes(rows)
        self.unsaved_changed.emit()

    def _deeds(self, take: RecordedTake) -> dict[str, Callable[[], None]]:
        """The commands of a take's menu, by their words; an unsaved take can only be played while one is written."""
        deeds: dict[str, Callable[[], None]] = {"Play": lambda: self.play_asked.emit(take)}
        if take.files:
            deeds["Show in folder"] = lambda: reveal(next(iter(take.files)), self._notices.report)
        if take.files or not self._writing.busy:
            rename = partial(ask_text, self._bar, "Rename take", "New name:")
            deeds["Rename …"] = lambda: rename(take.name, take.rename)
            deeds["Export …" if take.files else "Save …"] = lambda: self._export(take)
            deeds["Delete …"] = lambda: self._delete(take)
        return deeds

    def _do(self, deed: Callable[[], None], *_: bool) -> None:
        """Do what was chosen for a take."""
        try:
            deed()
        except OSError as error:
            self._notices.report(explain(Path(error.filename or recordings_folder()), error))
        self._show_takes()


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


def _words(played: Played, name: str) -> str:
    """A recording in a line: its name, when it was, how long, how many notes."""
    when = "" if played.recorded is None else f"{played.recorded.astimezone():%Y-%m-%d %H:%M}, "
    events = [timed_event.event for timed_event in played.events]
    notes = sum(isinstance(event, NoteOn) and event.velocity > 0 for event in events)
    length = f"{duration(played.events[-1].time_s)}, {notes} note{'' if notes == 1 else 's'}"
    return f"{one_line(name, LONGEST_NAME)}: {when}{length}"
