"""The compiled player's memory, as Python sees it: events go in, reports and levels come out.

Any thread may give events; the mixer's thread takes them up with its next quantum, and neither locks nor allocates.
"""

from __future__ import annotations

import itertools
import math
import threading
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from engine.kernels import constants as of
from engine.kernels.fields import record_of, slots
from engine.kernels.records import EVENT, PLAYER, REPORT, TABLE, player_slots
from engine.kernels.voice_records import OMEGA_SQUARED, SOUNDING, VOICE, WAITING, WEIGHT_ROWS, voice_bytes
from engine.pluck import SHAPES, Pluck
from engine.values.string import StringParameters
from engine.voices.memory import KernelMemory
from engine.voices.voice import possible_s

AT_HAND = 16  # notes whose memory is there from the start
PAGE_SLOTS = 512  # slots of 8 bytes in a page of 4 kB
LOG_DB = 20 / math.log(10)  # dB of a neper

REPORTED = tuple(name for name in REPORT.names or () if name != "own")


@dataclass(frozen=True, eq=False)
class Table(KernelMemory):
    """An instrument as the kernels read it, with the memory that it points to; a later one has a higher `serial`.

    Attributes:
        memory: `records.TABLE`, and what it points to.
        programs: of the sources of its notes.
    """

    memory: NDArray[np.float64]
    programs: tuple[NDArray[np.float64], ...] = ()

    @property
    def record(self) -> np.void:
        return record_of(self.memory, TABLE)

    @property
    def serial(self) -> int:
        return int(self.record["serial"])


@dataclass(frozen=True)
class NoteReport:
    """The report of what became of a note.

    Attributes:
        kind: BEGAN, ENDED or REFUSED of `constants`; for others than BEGAN only the first five count.
        id: of its event.
        frame: of the mixer.
        string: on which of a set it is played, from the highest, 0; -1: the key chooses.
        table: serial of its instrument's table.
        position, amplitude_mm, width: of the pluck; place and width in lengths of the string.
        gain: a factor, of the note.
        parameters: of its string as its key had it; None for drums, and for a string beyond the bounds.
        note: its place among the player's notes, 0 … MOST_NOTES - 1.
    """

    kind: int
    id: int
    channel: int
    key: int
    frame: int
    velocity: float = 0.0
    string: int = -1
    table: int = 0
    position: float = 0.0
    amplitude_mm: float = 0.0
    width: float = 0.0
    gain: float = 0.0
    modes: int = 0
    note: int = 0
    parameters: StringParameters | None = None


@dataclass(frozen=True)
class Ringing:
    """A note that rings.

    Attributes:
        level_db: of its loudest voice, in dB of full scale.
        seconds: how long it has been ringing, as far as the device was given it.
        string: on which of a set it is played, from the highest, 0; -1: the key chooses.
        length_m: of its string as it is now, between two keys while it slides; None for drums.
    """

    id: int
    channel: int
    key: int
    level_db: float
    seconds: float
    string: int = -1
    length_m: float | None = None


@dataclass(frozen=True)
class Playing:
    """The progress of a note that was begun.

    Attributes:
        seconds: how long it has been ringing, as far as the device was given it.
        began_frame: of the mixer; 0 until its voices have begun.
        struck_to_began_s: from the gesture to the callback that gave its first samples; None: not known.
    """

    seconds: float
    began_frame: int
    struck_to_began_s: float | None


@dataclass(frozen=True)
class Channel:
    """The wheels, pedals and footswitches of a MIDI channel.

    Attributes:
        bend: of the pitch wheel, -1 … 1.
        pedal: whether the pedal that sustains is down; the other truth values are footswitches.
        slide: 0 … 127; None: never moved.
        range_semitones: of the bend; None: never set, the instrument's own counts.
        mute, slide_time, volume, expression: 0 … 127.
        coarse_tuning, fine_tuning: in semitones, and in 1/8192 of one.
    """

    bend: float
    pedal: bool
    slide: int | None
    range_semitones: float | None
    mute: int
    legato: bool
    slides: bool
    slide_time: int
    harmonics: bool
    tremolo: bool
    strums: bool
    volume: int
    expression: int
    coarse_tuning: int
    fine_tuning: int


SWITCHES = ("pedal", "legato", "slides", "harmonics", "tremolo", "strums")  # in the order of the kernels
CHANNEL_VALUES = tuple(field.name for field in fields(Channel) if field.name not in SWITCHES)


class CompiledPlayer(KernelMemory):
    """The player of the instrument of its latest table, in the mixer that it is given to.

    An *event* is a gesture, such as a key, a wheel or another table. Events go through the *ring*, a part of the
    memory with room for `EVENTS` of them, to the mixer's thread. That thread renders *quanta* of 64 frames. A *note*
    is a key that was struck. It has a *voice* for each *source* of its table, such as the model and the truth. Its
    *place* is the string that it is played on, which the latest note there has. A *course* is strings of one key that
    sound together: each is a note, and the first, of `member` 0, stands for all in reports.

    Args:
        rate_hz: the mixer's.
        modes: partials that a voice has at most.
        most_notes: that ring at once; the oldest makes room.

    Attributes:
        missed: whether reports came faster than they were asked for, since `missing` was asked.
    """

    layout = PLAYER

    def __init__(self, rate_hz: int, modes: int = of.MOST_MODES, most_notes: int = 40) -> None:
        from engine.kernels.playing.events import begin  # Numba only when it is needed

        self.rate_hz = rate_hz
        self.memory = memory = np.zeros(player_slots(modes + of.MOST_PAIRS))
        self._voice_slots = voice_bytes(modes + of.MOST_PAIRS) // 8  # size of a voice's memory, in numbers of 8 bytes
        # slots up to the end of the first AT_HAND notes' voices
        at_hand = slots(PLAYER) + AT_HAND * of.MOST_SOURCES * self._voice_slots
        memory[slots(PLAYER) : at_hand : PAGE_SLOTS] = 0.0  # else the audio thread would wait for pages of memory
        self.record = record = record_of(memory, PLAYER)
        self._lock = threading.Lock()  # of what hands events over, or frees what they point to
        self._ids = itertools.count(1)  # numbers of events
        self._backlog: deque[NDArray[np.void]] = deque()  # events for which the ring has no room yet
        self._tables: deque[Table] = deque()  # which the kernel may be reading, or will; the oldest first
        self._struck: dict[int, NDArray[np.float64]] = {}  # speeds of drums' modes, by event, until it is reported
        self._read = 0  # reports that `reports` has been through
        self.missed = False
        record["rate_hz"] = rate_hz
        record["modes"] = modes + of.MOST_PAIRS  # some partials have a second mode, of the other polarisation
        record["most"] = most_notes
        record["source_gains"] = 1.0
        begin(self.address)

    # Events

    def give(
        self,
        kind: int,
        channel: int = 0,
        key: int = 0,
        value: float = 0.0,
        frame: int = 0,
        by_hand: Pluck | None = None,
        struck_s: float = 0.0,
        note: int = 0,
        struck: NDArray[np.float64] | None = None,
        string: int | None = None,
    ) -> int:
        """Hand an event over; return its number, which reports of a note carry. Any thread, at once; none is lost.

        Args:
            kind: NOTE_ON, NOTE_OFF, BEND or another kind of event of `constants`.
            channel: 0 … 16, of which 16 is the keys of the computer and the screen.
            key: of a note; else the number of a controller, or of one of the instrument's values.
            value: by kind: velocity, bend in -1 … 1, a controller's or a value's, semitones, or seconds of a fade.
            frame: of the mixer, at which it counts; 0: at once.
            struck_s: time of the gesture on the device's clock; 0: not known.
            by_hand: the pluck of a note; None: as the instrument and the velocity have it.
            note: the event's number of the note that is tuned, choked or cancelled; 0: any.
            struck: speeds (modes,) that 1 N s gives to a drum where it is struck; None: at its own place.
            string: of a note: on which of a set it is played, from the highest, 0; None: channel or key choose.
        """
        event = {"kind": kind, "channel": channel, "key": key, "value": value, "frame": frame, "struck_s": struck_s}
        if by_hand is not None:
            event |= {"position": by_hand.position, "amplitude_mm": by_hand.amplitude_mm, "width": by_hand.width}
            event["shape"] = SHAPES.index(by_hand.shape)
        if string is not None:
            event["string"] = string + 1
        with self._lock:
            number = next(self._ids)
            event["id"] = note if kind in (of.TUNE, of.CHOKE, of.CANCEL) else number
            if struck is not None:
                event |= {"struck": struck.ctypes.data, "struck_modes": len(struck)}
                self._struck[number] = struck
                while len(self._struck) > of.EVENTS + of.QUEUED:  # more events do not wait to be played
                    del self._struck[next(iter(self._struck))]
            self._push(event)
        return number

    def take(self, table: Table, frame: int = 0) -> None:
        """Play another table from a frame of the mixer on, 0: at once; strings that ring glide to it. Any thread."""
        with self._lock:
            self._tables.append(table)
            # tables before the one that the kernel plays are read no more
            while self._tables[0].serial < int(self.record["serial"]):
                self._tables.popleft()
            self._push({"kind": of.TABLE, "table": table.address, "frame": frame})

    def _push(self, values: Mapping[str, float]) -> None:
        """Hand over an event whose fields have these values, the others 0. The caller holds the lock."""
        event = np.zeros((), EVENT)
        for name, value in values.items():
            event[name] = value
        self._backlog.append(event)
        self._flush()

    def _flush(self) -> None:
        """Move events from the backlog to the ring, as far as it has room. The caller holds the lock."""
        pushed = int(self.record["pushed"])
        room = of.EVENTS - (pushed - int(self.record["taken"]))
        for number in range(min(room, len(self._backlog))):
            self.record["events"][(pushed + number) % of.EVENTS] = self._backlog.popleft()
            self.publish("pushed", pushed + number + 1)

    @property
    def waiting(self) -> int:
        """The number of events still to be played: in the backlog, in the ring, and taken for a later frame."""
        with self._lock:
            self._flush()
            ring = int(self.record["pushed"] - self.record["taken"])
            return ring + int(self.record["queued"]) + len(self._backlog)

    def catch_up(self, mixer_address: int) -> None:
        """Play what is due in the mixer's next quantum now, where no device takes its frames."""
        from engine.kernels.playing.events import play

        with self._lock:
            while True:
                self._flush()
                play(self.address, mixer_address)
                if not self._backlog or self.record["queued"] == of.QUEUED:
                    return

    def set_source_gains(self, gains: Iterable[float]) -> None:
        """Set the gain, a factor, of each source of the player's notes, source 0 first; what rings fades to it."""
        for source, gain in enumerate(gains):
            self.record["source_gains"][source] = gain

    def set_spares(self, spares: bool) -> None:
        """Set whether notes begin without voices of sources whose gain is 0: these cost nothing, and stay silent."""
        self.record["spares"] = spares

    def source_gain(self, source: int) -> float:
        """The gain of a source as it was set."""
        return float(self.record["source_gains"][source])

    # What there is

    def reports(self) -> list[NoteReport]:
        """The reports since this was asked for the last time; of very many only the latest. One thread asks."""
        with self._lock:
            self._flush()
        total, new_reports = int(self.record["reported"]), []
        self.missed |= total > self._read + of.REPORTS
        first, self._read = max(self._read, total - of.REPORTS), total
        for number in range(first, total):
            record = self.record["reports"][number % of.REPORTS].copy()
            if int(self.record["reported"]) - number >= of.REPORTS:
                self.missed = True  # it was written again meanwhile
                continue
            known = {name: record[name].item() for name in REPORTED}
            struck = record["kind"] == of.BEGAN and record["modes"] > 0
            new_reports.append(NoteReport(**known, parameters=_string(record["own"]) if struck else None))
        with self._lock:
            for report in new_reports:
                self._struck.pop(report.id, None)
        return new_reports

    def ringing(self) -> list[Ringing]:
        """The notes that ring, each the latest of its place; a course is one of them, by its first string.

        Any thread may ask; the levels are those of the latest quantum.
        """
        notes = []
        for number, note in enumerate(self._notes()):
            if note["state"] != of.RINGS or not note["has_place"] or note["member"]:
                continue
            alive = self._alive(number, note)
            if alive:
                level = max(float(voice["loudness"]) for voice in alive.values()) * LOG_DB
                frames = max(int(voice["frame"]) for voice in alive.values())
                id, channel, key, string = (int(note[name]) for name in ("id", "channel", "key", "string"))
                length_m = self._length_m(note, self.rows_of(number, min(alive)))
                notes.append(Ringing(id, channel, key, level, frames / self.rate_hz, string, length_m))
        return notes

    def _length_m(self, note: np.void, rows: NDArray[np.float64]) -> float | None:
        """The present length of a note's string in m; None: it is a drum's, or a string beyond the bounds.

        While a string slides, `string_now` is where it leads. Its length there is scaled by its first mode's
        frequency there over the present one.

        Args:
            rows: (rows, modes) of one of the note's voices.
        """
        if note["drum"]:
            return None
        string = _string(note["string_now"])
        if string is None:
            return None
        present = float(rows[OMEGA_SQUARED, 0])  # ω² of the first mode in (rad/s)²
        return string.length_m * (string.undamped_frequency(1) / math.sqrt(present) if present > 0.0 else 1.0)

    def missing(self, ids: Iterable[int]) -> list[int]:
        """The numbers, of these numbers of notes' events, whose notes have ended, where reports were missed.

        Empty while events wait, or where none were missed.
        """
        if not self.missed or self.waiting:
            return []
        self.missed = False
        rings = {int(note["id"]) for note in self._notes() if note["state"] == of.RINGS}
        return [id for id in ids if id not in rings]

    def playing(self, report: NoteReport) -> Playing | None:
        """The progress of a note that `report` says to have begun; None: it has ended. Any thread."""
        note = self.record["notes"][report.note].copy()
        if note["state"] != of.RINGS or note["id"] != report.id:
            return None
        voices = [*self._voices(report.note, note).values()]
        frames = max((int(voice["frame"]) for voice in voices), default=0)
        began = max((int(voice["began_frame"]) for voice in voices), default=0)
        known = began > 0 and bool(voices[0]["struck_s"])
        took_s = possible_s(voices[0]["began_s"] - voices[0]["struck_s"]) if known else None
        return Playing(seconds=frames / self.rate_hz, began_frame=max(0, began), struck_to_began_s=took_s)

    @property
    def rests(self) -> bool:
        """Return True if it has nothing to play, and nothing rings."""
        rings = any(self.record["notes"]["state"] == of.RINGS)
        return not (rings or self.record["sympathy"]["rings"] or self.waiting)

    @property
    def over(self) -> bool:
        """Return True if all its voices are over, also where no mixer plays its events any more."""
        return not any(self._alive(number, note) for number, note in enumerate(self._notes()))

    def release(self, seconds: float) -> None:
        """Fade all voices out within `seconds`, of a player whose events no mixer plays any more.

        A mixer may still be sounding these voices. A fade that is under way continues.
        """
        for number, note in enumerate(self._notes()):
            for voice in self._alive(number, note).values():
                if voice["release"] == 0:
                    voice["release"] = max(1, round(seconds * self.rate_hz))

    def _notes(self) -> NDArray[np.void]:
        """The notes (MOST_NOTES,) as they are now."""
        return self.record["notes"].copy()

    def _voices(self, number: int, note: np.void) -> dict[int, np.void]:
        """The records of a note's voices by their sources; none where it is free.

        Args:
            number: the note's place among the player's notes.
            note: its record.
        """
        sources = of.MOST_SOURCES if note["state"] == of.RINGS else 0
        return {source: self.voice(number, source) for source in range(sources) if note["voices"][source]}

    def _alive(self, number: int, note: np.void) -> dict[int, np.void]:
        """The records of a note's voices that are not over, by their sources."""
        voices = self._voices(number, note).items()
        return {source: voice for source, voice in voices if voice["state"] in (WAITING, SOUNDING)}

    def _memory_of(self, number: int, source: int) -> NDArray[np.float64]:
        """The memory (slots,) of the voice that note `number` has of a source; voices follow the player's record."""
        first = slots(PLAYER) + (number * of.MOST_SOURCES + source) * self._voice_slots
        return self.memory[first : first + self._voice_slots]

    def voice(self, number: int, source: int) -> np.void:
        """The record of the voice that note `number`, a place among the player's notes, has of a source."""
        return record_of(self._memory_of(number, source), VOICE)

    def rows_of(self, number: int, source: int) -> NDArray[np.float64]:
        """The rows (rows, modes) of that voice, with the memory behind them as far as it makes whole rows."""
        memory = self._memory_of(number, source)
        modes = int(record_of(memory, VOICE)["modes"])
        rows = memory[slots(VOICE) + WEIGHT_ROWS * modes :]
        return rows[: len(rows) // modes * modes].reshape(-1, modes)

    @property
    def wheel(self) -> tuple[int, int]:
        """The modulation wheel, 0 … 127, and the channel that moved it."""
        return int(self.record["wheel"]), int(self.record["wheel_by"])

    def channel(self, number: int) -> Channel:
        """The positions of a channel's wheels and pedals."""
        state = self.record["channels"][number].copy()
        values = {name: state[name].item() for name in CHANNEL_VALUES}
        values |= zip(SWITCHES, map(bool, state["switches"]), strict=True)
        values["mute"] = round(127 * values["mute"])
        for name in ("slide", "range_semitones"):
            values[name] = values[name] if values[name] >= 0 else None
        return Channel(**values)


def _string(row: NDArray[np.float64]) -> StringParameters | None:
    """The string of a row (8,) of the player's memory, `StringParameters`' fields; None: bent beyond the bounds."""
    try:
        return StringParameters(*row.tolist())
    except ValueError:
        return None
