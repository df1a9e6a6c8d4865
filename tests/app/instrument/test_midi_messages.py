"""Random MIDI files against a reading of their own: the generator knows which messages are to come, and when.

It writes what Standard MIDI Files 1.0 allows. A second kind of file has what other programs write beside it.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from fractions import Fraction

import pytest

from app.instrument.midi_messages import NotMidi, read_messages

FILES = 1_500
MOST = 10_000
FRAMES_HZ = {24: Fraction(24), 25: Fraction(25), 29: Fraction(30_000, 1_001), 30: Fraction(30)}
Timed = list[tuple[Fraction, tuple[int, int, int]]]


def number(value: int) -> bytes:
    """Of variable length, by the standard's own table of groups of seven bits."""
    groups = [value >> shift & 0x7F for shift in (21, 14, 7, 0)]
    while len(groups) > 1 and groups[0] == 0:
        groups.pop(0)
    return bytes([*(0x80 | group for group in groups[:-1]), groups[-1]])


@dataclass
class Written:
    """A file as it is written, and what is to be read of it: ticks, the place of the track, and what comes then."""

    division: int
    tracks: list[bytes] = field(default_factory=list)
    played: list[tuple[int, int, tuple[int, int, int]]] = field(default_factory=list)
    tempos: list[tuple[int, int, int]] = field(default_factory=list)

    @property
    def expected(self) -> Timed:
        return [(self.seconds(tick), message) for tick, _, message in sorted(self.played, key=lambda each: each[:2])]

    def seconds(self, tick: int) -> Fraction:
        if self.division & 0x8000:
            return tick / FRAMES_HZ[256 - (self.division >> 8)] / (self.division & 0xFF)
        total, before, tempo = Fraction(0), 0, 500_000
        for at, _, next_tempo in sorted(self.tempos, key=lambda each: each[:2]):
            if at > tick:
                break
            total += Fraction((at - before) * tempo, self.division * 1_000_000)
            before, tempo = at, next_tempo
        return total + Fraction((tick - before) * tempo, self.division * 1_000_000)


def channel_message(draw: random.Random) -> tuple[int, ...]:
    status = draw.choice((0x80, 0x90, 0x90, 0xA0, 0xB0, 0xC0, 0xD0, 0xE0)) | draw.randrange(16)
    return (status, *(draw.randrange(128) for _ in range(1 if status & 0xE0 == 0xC0 else 2)))


def other_message(draw: random.Random) -> bytes:
    """A system exclusive message, an escape with any bytes, or a text or an unknown kind of meta message."""
    data = draw.randbytes(draw.choice((0, 1, 3, 200)))
    kind = draw.randrange(4)
    if kind == 0:
        return b"\xf0" + number(len(data) + 1) + bytes(byte & 0x7F for byte in data) + b"\xf7"
    if kind == 1:
        return b"\xf7" + number(len(data)) + data
    return bytes([0xFF, draw.choice((0x01, 0x03, 0x05, 0x20, 0x54, 0x58, 0x59, 0x7E))]) + number(len(data)) + data


def written(draw: random.Random, loose: bool = False) -> Written:
    """A file's tracks. `loose`: running status continues across other messages, which the standard forbids."""
    rate = draw.choice((24, 25, 29, 30))
    found = Written(
        draw.choice((1, 24, 96, 480, 960, 32_767, 0x8000 | (256 - rate) << 8 | draw.choice((1, 40, 100))))
    )
    for track in range(draw.choice((1, 1, 2, 5))):
        raw, tick, running = b"", 0, 0
        for _ in range(draw.choice((0, 3, 30))):
            later = draw.choice((0, 0, 1, 127, 128, 500, 20_000, 2**21))
            tick, raw = tick + later, raw + number(later)
            kind = draw.random()
            if kind < 0.7:
                message = channel_message(draw)
                raw += bytes(message[1:] if message[0] == running and draw.random() < 0.8 else message)
                running = message[0]
                found.played.append((tick, track, (*message, 0)[:3]))  # type: ignore[arg-type]
            elif kind < 0.8:
                tempo = draw.choice((1, 250_000, 500_000, 2**24 - 1))
                raw += b"\xff\x51\x03" + tempo.to_bytes(3, "big")
                found.tempos.append((tick, track, tempo))
                running = running if loose else 0
            else:
                raw += other_message(draw)
                running = running if loose else 0
        found.tracks.append(raw + number(draw.choice((0, 100_000))) + b"\xff\x2f\x00")
    return found


def chunk(kind: bytes, data: bytes) -> bytes:
    return kind + len(data).to_bytes(4, "big") + data


def alien(draw: random.Random) -> bytes:
    if draw.random() < 0.7:
        return b""
    return chunk(
        draw.choice((b"XFIH", b"CASM", b"    ", b"abcd")), draw.choice((b"", b"MTrk\0\0\0\1x", draw.randbytes(33)))
    )


def header(song: Written, draw: random.Random, counted: int | None = None) -> bytes:
    kind = 0 if len(song.tracks) == 1 and draw.random() < 0.5 else 1
    counts = (kind, len(song.tracks) if counted is None else counted, song.division)
    return chunk(
        b"MThd", b"".join(each.to_bytes(2, "big") for each in counts) + draw.choice((b"", b"", b"\1\2", b"MTrk"))
    )


def within_riff(song: bytes, draw: random.Random) -> bytes:
    def part(kind: bytes, data: bytes) -> bytes:
        return kind + len(data).to_bytes(4, "little") + data + b"\0" * (len(data) % 2)

    before = b"".join(part(b"LIST", draw.randbytes(draw.choice((0, 5, 60)))) for _ in range(draw.randrange(3)))
    parts = before + part(b"data", song) + draw.choice((b"", part(b"DISP", b"abc")))
    return b"RIFF" + (4 + len(parts)).to_bytes(4, "little") + b"RMID" + parts


def same(file: bytes, song: Written) -> None:
    found, expected = read_messages(file, MOST).timed, song.expected
    assert [message for _, message in found] == [message for _, message in expected]
    assert [time_s for time_s, _ in found] == pytest.approx([float(time_s) for time_s, _ in expected], rel=1e-9)


def test_random_files_are_read_as_they_were_meant() -> None:
    for seed in range(FILES):
        draw = random.Random(f"valid:{seed}")
        song = written(draw)
        file = (
            header(song, draw) + b"".join(alien(draw) + chunk(b"MTrk", track) for track in song.tracks) + alien(draw)
        )
        same(within_riff(file, draw) if draw.random() < 0.2 else file, song)


def test_so_are_files_with_what_other_programs_write() -> None:
    """Wrong counts and lengths, junk behind a track, tracks without an end, and running status across messages."""
    for seed in range(FILES):
        draw = random.Random(f"loose:{seed}")
        song = written(draw, loose=True)
        file = header(song, draw, draw.choice((0, 1, len(song.tracks), 99)))
        for place, track in enumerate(song.tracks):
            last, fault = place == len(song.tracks) - 1, draw.randrange(6)
            size = len(track)
            if fault == 0:
                size += draw.choice((1, 3, 8, 100, 10_000))
            elif fault == 1:
                size = max(0, size - draw.choice((1, 4, 30)))
            elif fault == 2:
                track += draw.choice((b"\0", b"\0\0\0", b"\xff\xff"))
                size = len(track)
            elif fault == 3:
                track = track[
                    : -len(number(100_000) if track.endswith(number(100_000) + b"\xff\x2f\0") else b"\0") - 3
                ]
                size = len(track)
            elif fault == 4 and last:
                track += b"\0" * draw.choice((1, 4, 77))
            file += b"MTrk" + size.to_bytes(4, "big") + track
        same(file, song)


@pytest.mark.parametrize("division", [b"\xe8\x28", b"\xe7\x28", b"\xe3\x28", b"\xe2\x28"])
def test_frames_are_counted_at_all_four_rates(division: bytes) -> None:
    rate = FRAMES_HZ[256 - division[0]]
    track = b"\0\x90\x3c\x40" + number(4_000) + b"\x80\x3c\x40" + b"\0\xff\x51\x03\0\0\1" + number(40) + b"\xc0\1"
    file = chunk(b"MThd", b"\0\0\0\1" + division) + chunk(b"MTrk", track)
    times_s = [time_s for time_s, _ in read_messages(file, MOST).timed]
    assert times_s == pytest.approx([0.0, 4_000 / 40 / rate, 4_040 / 40 / rate])  # whatever the tempo


def test_values_above_127_cost_no_more_than_their_message() -> None:
    track = b"\0\xb0\x07\xff" + b"\0\x90\xfe\x40" + b"\0\x90\x3c\xff" + b"\0\xe0\x80\xc0" + b"\0\xb0\x87\x11"
    found = read_messages(chunk(b"MThd", b"\0\0\0\1\0\x60") + chunk(b"MTrk", track), MOST)
    assert [message for _, message in found.timed] == [(0xB0, 7, 127), (0x90, 60, 127), (0xE0, 127, 127)]
    assert (found.clipped, found.skipped) == (3, 2)


def test_a_tempo_of_0_is_none_and_of_several_at_a_tick_the_last_counts() -> None:
    tempos = b"".join(b"\0\xff\x51\x03" + tempo.to_bytes(3, "big") for tempo in (1, 1_000_000, 0))
    file = chunk(b"MThd", b"\0\0\0\1\0\x60") + chunk(b"MTrk", tempos + b"\x60\x90\x3c\x40")
    assert read_messages(file, MOST).timed == [(1.0, (0x90, 60, 64))]


@pytest.mark.parametrize(
    ("file", "reported"),
    [
        (b"MThd\0\0\0\2\0\0", "header"),
        (chunk(b"MThd", b"\0\2\0\2\0\x60") + 2 * chunk(b"MTrk", b"\0\x90\x3c\x40"), "2 songs of their own"),
        (chunk(b"MThd", b"\0\0\0\1\0\x60") + chunk(b"MTrk", b"\0\x3c\x40"), "the kind of a message"),
        (chunk(b"MThd", b"\0\0\0\1\0\x60") + chunk(b"MTrk", b"\0\x90\x3c"), "within a message"),
        (chunk(b"MThd", b"\0\0\0\1\0\x60") + chunk(b"MTrk", b"\xff\xff\xff\xff\x7f\x90\x3c\x40"), "has no end"),
        (chunk(b"MThd", b"\0\0\0\1\0\x60") + chunk(b"MTrk", b"\0\x90\x3c\x40" * (MOST + 1)), "more than [0-9,]+ m"),
        (b"RIFF\x24\0\0\0WAVEfmt ", "another kind of RIFF"),
    ],
)
def test_what_cannot_be_read_is_refused(file: bytes, reported: str) -> None:
    with pytest.raises(NotMidi, match=reported):
        read_messages(file, MOST)


def test_one_song_of_format_2_is_read() -> None:
    file = chunk(b"MThd", b"\0\2\0\1\0\x60") + chunk(b"MTrk", b"\0\x90\x3c\x40")
    assert read_messages(file, MOST).timed == [(0.0, (0x90, 60, 64))]
