"""The channel messages of a Standard MIDI File with their times in s, as far as the file is whole.

Sources: Standard MIDI Files 1.0 (MMA RP-001) and, of .rmi files, RIFF's form RMID (MMA RP-029). Deviations that
other programs write and most players accept are accepted. These are chunks of any kind between tracks, another number
of tracks than the header's, and tracks without their end. So are lengths that are too
long or too short, and running status across other messages.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

LONGEST_NUMBER = 4  # bytes of a number of variable length, by the standard
USUAL_TEMPO_US = 500_000  # of a quarter note
FRAME_RATES_HZ = {24: 24.0, 25: 25.0, 29: 30_000 / 1_001, 30: 30.0}  # SMPTE's; 29: 30 drop
META = 0xFF
TEMPO = 0x51
END_OF_TRACK = 0x2F
SYSTEM_EXCLUSIVE = (0xF0, 0xF7)  # and what follows an escape: a length, then any bytes
DATA_BYTES = {0x80: 2, 0x90: 2, 0xA0: 2, 0xB0: 2, 0xC0: 1, 0xD0: 1, 0xE0: 2, 0xF1: 1, 0xF2: 2, 0xF3: 1}  # by kind
LARGEST_VALUE = 127

Message = tuple[int, int, int]  # status and two data bytes; 0 for what it does not have


class NotMidi(ValueError):
    """The bytes are no MIDI file, or one that cannot be played; the message says why, without the file's name."""


@dataclass(frozen=True)
class MidiMessages:
    """The messages that a file holds.

    Attributes:
        timed: times in s and channel messages, in the order in which they are played.
        missing_tracks: how many tracks fewer there are than the header says.
        clipped: messages with a value above 127, which were read as 127.
        skipped: messages with a key or a controller above 127, which were left out.
    """

    timed: list[tuple[float, Message]]
    missing_tracks: int = 0
    clipped: int = 0
    skipped: int = 0


def read_messages(file: bytes, most: int) -> MidiMessages:
    """The messages of all tracks of a file.

    Args:
        most: messages of any kind that the file may have.

    Raises:
        NotMidi: the bytes are no MIDI file, are cut off within a message, or hold too much.
    """
    raw = _within_riff(file)
    if raw[:4] != b"MThd":
        raise NotMidi("is no MIDI file: it does not begin with MThd")
    header = int.from_bytes(raw[4:8], "big")
    if header < 6 or len(raw) < 8 + header:
        raise NotMidi("is no MIDI file, or not a whole one: its header is too short")
    kind, counted, division = (int.from_bytes(raw[place : place + 2], "big") for place in (8, 10, 12))
    clock = _Clock(division)
    reader = _Reader(raw, most)
    reader.read_tracks(8 + header)
    if kind == 2 and reader.tracks > 1:
        raise NotMidi(f"holds {reader.tracks} songs of their own (format 2): save one of them in a file")
    return MidiMessages(
        list(clock.timed(sorted(reader.ticked, key=lambda message: message[0]))),
        max(0, counted - reader.tracks),
        reader.clipped,
        reader.skipped,
    )


def _within_riff(file: bytes) -> bytes:
    """The MIDI file within an .rmi file; any other as it is."""
    if file[:4] != b"RIFF":
        return file
    if file[8:12] != b"RMID":
        raise NotMidi("is no MIDI file, but another kind of RIFF file")
    place = 12
    while place + 8 <= len(file):
        length = int.from_bytes(file[place + 4 : place + 8], "little")
        if file[place : place + 4] == b"data":
            return file[place + 8 :] if length == 0 else file[place + 8 : place + 8 + length]
        place += 8 + length
        if length % 2 and file[place : place + 1] == b"\0":  # some programs leave the padding out
            place += 1
    raise NotMidi("is no MIDI file, or not a whole one: it has no chunk of data")


class _Clock:
    """Ticks in s, by a header's division and the tempo."""

    def __init__(self, division: int) -> None:
        self._by_frames = bool(division & 0x8000)  # ticks are parts of SMPTE's frames, not of a quarter note
        if self._by_frames:
            rate, ticks = 256 - (division >> 8), division & 0xFF
            if rate not in FRAME_RATES_HZ or ticks == 0:
                raise NotMidi("counts frames at a rate that MIDI does not have")
            self._tick_s = 1 / (FRAME_RATES_HZ[rate] * ticks)
        elif division == 0:
            raise NotMidi("counts no ticks in a quarter note (a division of 0)")
        else:
            self._ticks = division
            self._tick_s = USUAL_TEMPO_US / 1e6 / division  # by the latest tempo

    def timed(self, ticked: list[tuple[int, int | Message]]) -> Iterator[tuple[float, Message]]:
        """Channel messages with their times in s, of (tick, message or tempo in µs a quarter note) by rising tick.

        A tempo of 0 is ignored, and so is any where ticks are parts of frames.
        """
        time_s, before = 0.0, 0
        for tick, message in ticked:
            time_s += (tick - before) * self._tick_s
            before = tick
            if not isinstance(message, int):
                yield time_s, message
            elif message > 0 and not self._by_frames:
                self._tick_s = message / 1e6 / self._ticks


class _Reader:
    """A reader of the tracks of a file; places are bytes from its beginning.

    Attributes:
        ticked: ticks from the beginning, and a channel message or a tempo in µs, track by track.
    """

    def __init__(self, raw: bytes, most_messages: int) -> None:
        self._raw = raw
        self._most = most_messages
        self._left = most_messages  # how many may still be read
        self.ticked: list[tuple[int, int | Message]] = []
        self.tracks = self.clipped = self.skipped = 0

    def read_tracks(self, place: int) -> None:
        """Read all tracks from a place on, whatever stands between them."""
        raw = self._raw
        while 0 <= place <= len(raw) - 8:
            end = place + 8 + int.from_bytes(raw[place + 4 : place + 8], "big")
            if raw[place : place + 4] == b"MTrk":
                self.tracks += 1
                place = self._read_track(place + 8, end)
            elif self._begins_chunk(place):
                place = end
            else:
                place = raw.find(b"MTrk", place + 1)

    def _begins_chunk(self, place: int) -> bool:
        """Return True if a track begins at a place, or another whole chunk with a kind of four ASCII characters."""
        kind, length = self._raw[place : place + 4], int.from_bytes(self._raw[place + 4 : place + 8], "big")
        named = len(kind) == 4 and all(0x20 <= byte < 0x7F for byte in kind)
        return kind == b"MTrk" or (named and place + 8 + length <= len(self._raw))

    def _read_track(self, place: int, end: int) -> int:
        """Read a track of a length that may be wrong; return the place where the next chunk may begin.

        Args:
            place: of its first message.
            end: the place behind it by the length that it states.
        """
        raw, length_is_right = self._raw, end == len(self._raw) or self._begins_chunk(end)
        limit = end if length_is_right else len(raw)
        tick = running = 0
        up_to_end = None  # count of messages and place where the stated length was passed; None: not yet
        try:
            while place < limit:
                if up_to_end is None and place >= end:
                    up_to_end = len(self.ticked), place
                self._left -= 1
                if self._left < 0:
                    raise NotMidi(f"has more than {self._most:,} messages")
                later, place = self._number(place, limit)
                tick += later
                running, place, ended = self._read_message(tick, running, place, limit)
                if ended:
                    after = raw[place : place + 4] == b"MTrk"
                    return end if length_is_right and not after else place
        except _CutOff as error:
            if up_to_end is None:
                raise NotMidi(str(error)) from error
        if up_to_end is not None:  # what follows is no part of it: the track has no end
            count, place = up_to_end
            del self.ticked[count:]
            return place
        return limit

    def _read_message(self, tick: int, running: int, place: int, limit: int) -> tuple[int, int, bool]:
        """Read a message and keep it, if it is a channel message or a tempo.

        Args:
            running: the status of a message that has none of its own; 0: none yet.
            limit: the place that a message may not pass.

        Returns:
            The running status from here on, the place behind the message, and whether it ends the track.
        """
        raw = self._raw
        if place >= limit:
            raise _CutOff("is no MIDI file, or not a whole one: a track ends within a message")
        status = raw[place]
        if status >= 0x80:
            place += 1
        elif running:
            status = running
        else:
            raise _CutOff("is no MIDI file: it does not tell the kind of a message")
        if status == META:
            kind = raw[place] if place < limit else 0
            length, first = self._number(place + 1, limit)
            place = first + length
            if kind == END_OF_TRACK:
                return running, min(place, limit), True
            if kind == TEMPO and length >= 3 and place <= limit:
                self.ticked.append((tick, int.from_bytes(raw[first : first + 3], "big")))
        elif status in SYSTEM_EXCLUSIVE:
            length, place = self._number(place, limit)
            place += length
        else:
            data = raw[place : place + DATA_BYTES.get(status & 0xF0 if status < 0xF0 else status, 0)]
            place += DATA_BYTES.get(status & 0xF0 if status < 0xF0 else status, 0)
            if status < 0xF0 and place <= limit:
                running = status
                self._take(tick, status, data)
        if place > limit:
            raise _CutOff("is no MIDI file, or not a whole one: a track ends within a message")
        return running, place, False

    def _take(self, tick: int, status: int, data: bytes) -> None:
        """Keep a channel message; values are at most 127."""
        first, second = data[0], data[1] if len(data) > 1 else 0
        if first > LARGEST_VALUE and status < 0xC0:  # another key, or controller, would be played
            self.skipped += 1
            return
        if max(first, second) > LARGEST_VALUE:
            self.clipped += 1
        self.ticked.append((tick, (status, min(first, LARGEST_VALUE), min(second, LARGEST_VALUE))))

    def _number(self, place: int, limit: int) -> tuple[int, int]:
        """A number of variable length (seven bits a byte), and the place after it."""
        value = 0
        for at in range(place, min(place + LONGEST_NUMBER, limit)):
            value = value << 7 | self._raw[at] & 0x7F
            if self._raw[at] < 0x80:
                return value, at + 1
        raise _CutOff("is no MIDI file: a number in it has no end")


class _CutOff(Exception):
    """A track cannot be read on from here."""
