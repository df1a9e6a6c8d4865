"""A recording on disk while it is made and until it is saved. Each event is a line of JSON, appended.

A process that is killed leaves its journal. The next start finds it, for the lock beside it is no living process's.
Lines are short: after the first, an instrument that is turned is the fields that changed. A torn last line is left
out; of a damaged journal the events before the damage are kept.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, get_args

from platformdirs import user_state_path
from pydantic import TypeAdapter
from PySide6.QtCore import QLockFile

from app.export.played import Played
from app.instruments.instrument import Instrument
from app.player.events import (
    LONGEST_RECORDING,
    Bend,
    ControlChange,
    Event,
    InstrumentTurned,
    Meter,
    NoteOff,
    NoteOn,
    TimedEvent,
    played_from,
)
from app.shared.vocabulary import DIFFERENCE_GAIN_RANGE_DB, PlayedSource
from engine import bounds
from engine.plain_text import one_line
from engine.schema import SchemaError, parse_json
from engine.whole_file import read_bounded

FOLDER_VARIABLE = "LEARNED_STRINGS_RECORDINGS"
SUFFIX = ".recording"
VERSION = 1
LARGEST_BYTES = 256 * 2**20
LONGEST_S = 7 * 24 * 3600.0
KINDS: dict[str, type[NoteOn | NoteOff | Bend | ControlChange]] = {
    "on": NoteOn,
    "off": NoteOff,
    "bend": Bend,
    "controller": ControlChange,
}
_NAMES = {kind: name for name, kind in KINDS.items()}
_CHECKED = {name: TypeAdapter(kind) for name, kind in KINDS.items()}
_RECORDED = TypeAdapter(datetime)


def recordings_folder() -> Path:
    """The path in LEARNED_STRINGS_RECORDINGS, else `recordings` in the platform's folder for a program's state."""
    folder = os.environ.get(FOLDER_VARIABLE)
    return Path(folder) if folder else user_state_path("learned-strings", appauthor=False) / "recordings"


class Journal:
    """The file of one recording, of this process alone; `close` leaves it to the next start, `delete` removes it."""

    def __init__(self, path: Path, lock: QLockFile) -> None:
        self.path, self._lock = path, lock
        self._instrument: dict[str, Any] | None = None  # as it was written last

    @classmethod
    def begun(cls, folder: Path, recorded: datetime, meter: Meter | None = None) -> Journal:
        """A new journal, with its first line written. Raises OSError: the folder cannot be made or written."""
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{recorded:%Y%m%d-%H%M%S-%f}-{os.getpid()}{SUFFIX}"
        if (lock := _lock_of(path)) is None:
            raise PermissionError(None, "its lock cannot be made", str(path))
        journal = cls(path, lock)
        try:
            counted = {} if meter is None else {"meter": meter.model_dump()}
            journal._append([{"version": VERSION, "recorded": recorded.isoformat(), **counted}])
        except OSError:
            journal.delete()
            raise
        return journal

    def write(self, events: Iterable[TimedEvent]) -> None:
        """Append events, in the order of their times from the beginning of the recording. Raises OSError."""
        self._append([self._line(event) for event in events])

    def hear(self, source: PlayedSource, difference_gain_db: float) -> None:
        """Append the source that is heard from now on. Raises OSError."""
        self._append([{"source": source, "difference_gain_db": difference_gain_db}])

    def end(self, end_s: float) -> None:
        """Append the time at which the recording ended. Raises OSError."""
        self._append([{"end": end_s}])

    def close(self) -> None:
        """Leave the journal to the next start, or to another process."""
        self._lock.unlock()

    def delete(self) -> None:
        """Remove the journal: the recording is saved, or not wanted. Where that fails, it is offered again."""
        with suppress(OSError):
            self.path.unlink(missing_ok=True)
        self._lock.unlock()

    def read(self, check: Callable[[], None] = lambda: None) -> Played | None:
        """The recording as far as it was written; None: there is no note in it.

        Args:
            check: is called at each line; may raise, which ends the reading.

        Raises:
            ValueError: nothing of it can be used; the message names the file.
            OSError: it cannot be read.
        """
        raw = read_bounded(self.path, LARGEST_BYTES)
        read = _Read(str(self.path))
        for line in raw.split(b"\n")[:-1]:  # behind the last end of a line nothing is whole
            check()
            if not read.take(line):
                break
        return read.played()

    def _line(self, entry: TimedEvent) -> dict[str, Any]:
        """The JSON object of an event, `t` in s; of an instrument after the first only the fields that changed."""
        event, line = entry.event, {"t": entry.time_s}
        if isinstance(event, InstrumentTurned):
            before, now = self._instrument, event.instrument.model_dump(mode="json")
            self._instrument = now
            change = {"instrument": now} if before is None else {"turned": list(_changes(before, now))}
            return {**line, **change}
        return {**line, _NAMES[type(event)]: asdict(event)}  # type: ignore[index]

    def _append(self, lines: list[dict[str, Any]]) -> None:
        """Append JSON objects, a line each, and return when they are on the disk. Raises OSError."""
        if not lines:
            return
        with self.path.open("ab") as file:
            file.write("".join(json.dumps(line, allow_nan=False) + "\n" for line in lines).encode())
            file.flush()
            os.fsync(file.fileno())


def left_journals(folder: Path) -> list[Journal]:
    """The journals of processes that are no more, the oldest first; this process has them from now on."""
    try:
        paths = sorted(path for path in folder.glob(f"*{SUFFIX}") if path.is_file())
    except OSError:
        return []
    return [Journal(path, lock) for path in paths if (lock := _lock_of(path)) is not None]


def _lock_of(path: Path) -> QLockFile | None:
    """The lock of a journal; None: another process has it, or it cannot be made."""
    lock = QLockFile(str(path.with_suffix(".lock")))
    lock.setStaleLockTime(0)  # a lock is as old as its process; one of a dead process does not count
    return lock if lock.tryLock(0) else None


def _changes(before: Any, after: Any, *path: str) -> Iterator[tuple[list[str], Any]]:
    """The innermost values that differ, each with the path of keys to it."""
    if isinstance(before, dict) and isinstance(after, dict) and before.keys() == after.keys():
        for key, value in after.items():
            yield from _changes(before[key], value, *path, key)
    elif before != after:
        yield list(path), after


@dataclass
class _Read:
    """The content of the lines so far. Each is checked, as of any file.

    Attributes:
        where: the path of the file, for messages.
        recorded: when the recording began; None: the first line has not been read.
        end_s: when it ended, from its beginning; None: no line says so.
    """

    where: str
    recorded: datetime | None = None
    events: list[TimedEvent] = field(default_factory=list)
    source: PlayedSource = "model"
    difference_gain_db: float = 0.0
    end_s: float | None = None
    meter: Meter | None = None
    _instrument: dict[str, Any] | None = None  # the fields of the present one; None: no line has had one yet

    def take(self, line: bytes) -> bool:
        """Take a line; return False where it is damaged or fills the recording: nothing after it counts.

        Raises:
            ValueError: it is the first, and no journal's.
        """
        try:
            data = parse_json(line, self.where)
            if not isinstance(data, dict):
                raise SchemaError(f"{self.where}: a line is no JSON object")
            self._take_line(data)
        except (ValueError, LookupError, TypeError, OverflowError) as error:
            if self.recorded is None:
                reason = one_line(str(error), 200)
                raise ValueError(f"{self.where}: no recording of this program ({reason})") from error
            return False
        return len(self.events) < LONGEST_RECORDING

    def _take_line(self, data: dict[str, Any]) -> None:
        """Add the content of a line. Raises ValueError: it is not as this program writes it."""
        if self.recorded is None:
            if data.get("version") != VERSION:
                raise ValueError("version: made by another version of the program")
            self.meter = Meter.model_validate(data["meter"]) if "meter" in data else None
            self.recorded = _RECORDED.validate_python(data["recorded"])
        elif "end" in data:
            self.end_s = _number_within(data["end"], (0.0, LONGEST_S))
        elif "source" in data:
            if data["source"] not in get_args(PlayedSource):
                raise ValueError("source")
            self.source = data["source"]
            self.difference_gain_db = _number_within(data["difference_gain_db"], DIFFERENCE_GAIN_RANGE_DB)
        else:
            time_s = _number_within(data.pop("t"), (-LONGEST_S, LONGEST_S))
            ((kind, value),) = data.items()
            kind = "instrument" if kind == "patch" else kind  # of earlier versions
            self.events.append(TimedEvent(time_s, self._event(kind, value)))

    def _event(self, kind: str, value: Any) -> Event:
        if kind in ("instrument", "turned"):
            return InstrumentTurned(Instrument.model_validate(self._turn_instrument(kind, value)))
        return _CHECKED[kind].validate_python(value)

    def _turn_instrument(self, kind: str, value: Any) -> dict[str, Any]:
        """The instrument's fields after a line of this kind.

        `value`: all fields for "instrument"; for "turned" the changed ones, each a path of keys with its new value.
        """
        if kind == "instrument":
            self._instrument = dict(value)
            return self._instrument
        for path, changed in value:
            part: Any = self._instrument
            for key in path[:-1]:
                part = part[key]
            if not isinstance(part, dict) or path[-1] not in part:
                raise ValueError("turned: no such field")
            part[path[-1]] = changed
        assert self._instrument is not None
        return self._instrument

    def played(self) -> Played | None:
        """The recording, with what is down at its end released."""
        if self.recorded is None:
            raise ValueError(f"{self.where}: no recording of this program (it is empty)")
        turned = (entry.event for entry in self.events if isinstance(entry.event, InstrumentTurned))
        instrument = next((event.instrument for event in turned), None)
        last_s = max((entry.time_s for entry in self.events), default=0.0)
        events = played_from(self.events, last_s if self.end_s is None else self.end_s, self.meter is not None)
        if instrument is None or not events:
            return None
        return Played(instrument, tuple(events), self.source, self.difference_gain_db, self.recorded, self.meter)


def _number_within(value: Any, limits: tuple[float, float]) -> Any:
    """Return the number. Raises ValueError: it is out of its limits, or none."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not limits[0] <= value <= limits[1]:
        raise ValueError(f"{bounds.brief(str(value))} is out of range")
    return value
