"""MIDI: random files against a reading of their own, what is written is read again, and one line for what is not.

The generator writes what Standard MIDI Files 1.0 allows, and knows which messages are to come, and when.
A second kind of file has what other programs write beside it.
"""

import random
import shlex
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import mido
import pytest

from app.instruments.instrument import Instrument
from app.instruments.library import SHIPPED, read_instrument
from app.player.events import (
    KEYS,
    Bend,
    ControlChange,
    Event,
    InstrumentTurned,
    NoteOff,
    NoteOn,
    TimedEvent,
    bend_range,
    channels_in,
    release_all,
)
from app.player.general_midi import FAMILIES
from app.player.midi_file import MidiFileError, SongPart, midi_bytes, read_midi, read_parts, read_song
from app.player.midi_messages import NotMidi, read_messages

FILES = 400
MOST = 10_000
FRAMES_HZ = {24: Fraction(24), 25: Fraction(25), 29: Fraction(30_000, 1_001), 30: Fraction(30)}
Timed = list[tuple[Fraction, tuple[int, int, int]]]


def number(value: int) -> bytes:
    """Of variable length, by the standard's own table of groups of seven bits."""
    groups = [value >> shift & 0x7F for shift in (21, 14, 7, 0)]
    while len(groups) > 1 and groups[0] == 0:
        groups.pop(0)
    return bytes([*(0x80 | group for group in groups[:-1]), groups[-1]])


def chunk(kind: bytes, data: bytes) -> bytes:
    return kind + len(data).to_bytes(4, "big") + data


def one_track(*messages: bytes, header: bytes = b"\0\0\0\1\0\x60") -> bytes:
    """A file of one track, each message with its delta time before it."""
    return chunk(b"MThd", header) + chunk(b"MTrk", b"".join(messages))


ON = b"\0\x90\x3c\x40"


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


def written(draw: random.Random, loose: bool) -> Written:
    """A file's tracks. `loose`: running status continues across other messages, which the standard forbids."""
    frames = 0x8000 | (256 - draw.choice((24, 25, 29, 30))) << 8 | draw.choice((1, 40, 100))
    found = Written(draw.choice((1, 24, 96, 480, 960, 32_767, frames)))
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
                continue
            if kind < 0.8:
                tempo = draw.choice((1, 250_000, 500_000, 2**24 - 1))
                raw += b"\xff\x51\x03" + tempo.to_bytes(3, "big")
                found.tempos.append((tick, track, tempo))
            else:
                raw += other_message(draw)
            running = running if loose else 0
        found.tracks.append(raw + number(draw.choice((0, 100_000))) + b"\xff\x2f\x00")
    return found


def strict_file(song: Written, draw: random.Random) -> bytes:
    """With chunks of other programs among its tracks, now and then within a RIFF."""

    def alien() -> bytes:
        kind, data = draw.choice((b"XFIH", b"    ")), draw.choice((b"", b"MTrk\0\0\0\1x", draw.randbytes(33)))
        return b"" if draw.random() < 0.7 else chunk(kind, data)

    def part(kind: bytes, data: bytes) -> bytes:
        return kind + len(data).to_bytes(4, "little") + data + b"\0" * (len(data) % 2)

    file = header(song, len(song.tracks), draw)
    file += b"".join(alien() + chunk(b"MTrk", track) for track in song.tracks) + alien()
    if draw.random() < 0.8:
        return file
    before = b"".join(part(b"LIST", draw.randbytes(draw.choice((0, 5, 60)))) for _ in range(draw.randrange(3)))
    return part(b"RIFF", b"RMID" + before + part(b"data", file) + draw.choice((b"", part(b"DISP", b"abc"))))


def loose_file(song: Written, draw: random.Random) -> bytes:
    """With a wrong count of tracks; some with a wrong length, junk behind them, or without their end."""
    file = header(song, draw.choice((0, 1, len(song.tracks), 99)), draw)
    for track in song.tracks:
        fault, size = draw.randrange(6), len(track)
        if fault == 0:
            size += draw.choice((1, 3, 8, 100, 10_000))
        elif fault == 1:
            size = max(0, size - draw.choice((1, 4, 30)))
        elif fault == 2:
            track += draw.choice((b"\0", b"\0\0\0", b"\xff\xff"))
            size = len(track)
        elif fault == 3:
            end = number(100_000) + b"\xff\x2f\0"
            track = track[: -len(end) if track.endswith(end) else -4]
            size = len(track)
        elif fault == 4 and track is song.tracks[-1]:
            track += b"\0" * draw.choice((1, 4, 77))
        file += b"MTrk" + size.to_bytes(4, "big") + track
    return file


def header(song: Written, counted: int, draw: random.Random) -> bytes:
    kind = 0 if len(song.tracks) == 1 and draw.random() < 0.5 else 1
    counts = b"".join(each.to_bytes(2, "big") for each in (kind, counted, song.division))
    return chunk(b"MThd", counts + draw.choice((b"", b"", b"\1\2", b"MTrk")))


def held_to(file: bytes, expected: Timed) -> None:
    found = read_messages(file, MOST).timed
    assert [message for _, message in found] == [message for _, message in expected]
    assert [each for each, _ in found] == pytest.approx([float(each) for each, _ in expected], rel=1e-9)


@pytest.mark.parametrize("loose", [False, True])
def test_random_files_are_read_as_they_were_meant(loose):
    for seed in range(FILES):
        draw = random.Random(f"{loose}:{seed}")
        song = written(draw, loose)
        held_to((loose_file if loose else strict_file)(song, draw), song.expected)


def test_times_of_messages_and_values_above_127():
    tempos = [b"\0\xff\x51\x03" + tempo.to_bytes(3, "big") for tempo in (1, 1_000_000, 0)]
    note = (0x90, 60, 64)
    held_to(one_track(*tempos, b"\x60\x90\x3c\x40"), [(Fraction(1), note)])  # 0 is none; of several the last counts
    held_to(one_track(ON, header=b"\0\2\0\1\0\x60"), [(Fraction(0), note)])  # one song of format 2
    for rate, hz in FRAMES_HZ.items():
        frames, later = b"\0\0\0\1" + bytes([256 - rate, 40]), (4_000 / 40 / hz, (0x80, 60, 64))
        file = one_track(ON, number(4_000) + b"\x80\x3c\x40", tempos[0], header=frames)
        held_to(file, [(Fraction(0), note), later])
    odd = (b"\0\xb0\x07\xff", b"\0\x90\xfe\x40", b"\0\x90\x3c\xff", b"\0\xe0\x80\xc0", b"\0\xb0\x87\x11")
    found = read_messages(one_track(*odd), MOST)
    assert [message for _, message in found.timed] == [(0xB0, 7, 127), (0x90, 60, 127), (0xE0, 127, 127)]
    assert (found.clipped, found.skipped) == (3, 2)


# Written and read again


PLAYED = [
    TimedEvent(0.0, NoteOn(60, 90, 2)),
    TimedEvent(0.25, Bend(-0.5, 2)),
    TimedEvent(0.5, ControlChange(64, 127, 2)),
    TimedEvent(0.75, Bend(1.0, 2)),
    TimedEvent(1.5, NoteOff(60, 2)),
]
WHOLE = midi_bytes(PLAYED)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "song.mid"


def test_what_is_written_is_read_again_also_by_another_program(file, instrument):
    """Without controllers long after the last note, which are no music."""
    late = (TimedEvent(600.0, ControlChange(64, 0)), TimedEvent(5_000.0, Bend(0.0)))
    file.write_bytes(midi_bytes([*PLAYED, *late]))
    found = read_midi(file)
    assert [each.time_s for each in found] == pytest.approx([each.time_s for each in PLAYED], abs=1e-3)
    bends = [each.event.value for each in found if isinstance(each.event, Bend)]
    assert bends == pytest.approx([-0.5, 1.0], abs=2e-4)
    assert [each.event for each in found][::2] == [each.event for each in PLAYED][::2]
    file.write_bytes(WHOLE)
    read = mido.MidiFile(file)
    assert read.length == pytest.approx(1.5, abs=1e-3)
    assert [message.type for message in read.tracks[0]][1:3] == ["note_on", "pitchwheel"]
    assert midi_bytes([TimedEvent(0.0, InstrumentTurned(instrument)), *PLAYED]) == WHOLE, "a knob is no MIDI"


INSTRUMENT = read_instrument(SHIPPED / "long_wire.json").model_copy(update={"range": (0, 127)})
NARROW = INSTRUMENT.model_copy(update={"name": "test", "mode": "poly", "bend_semitones": 2.0})
WIDE = NARROW.model_copy(update={"bend_semitones": 12.5})
ANOTHER = WIDE.model_copy(update={"name": "another", "bend_semitones": 5.0})


def test_a_recording_has_the_range_of_bends_of_each_channel_and_lets_go_of_them(file):
    first, two = TimedEvent(0.0, NoteOn(50, 90, 0)), TimedEvent(0.1, NoteOn(52, 90, 3))
    own_range = [TimedEvent(0.1, event) for event in bend_range(24, 1)]
    turned = [TimedEvent(0.2, InstrumentTurned(WIDE)), TimedEvent(0.3, InstrumentTurned(ANOTHER))]
    let_go = [TimedEvent(0.3, event) for event in release_all([1])]

    def read(instrument: Instrument, *played: TimedEvent) -> list[Event]:
        file.write_bytes(midi_bytes(list(played), instrument))
        return [each.event for each in read_midi(file)]

    found = read(WIDE, TimedEvent(0.0, NoteOn(50, 90, KEYS)), two)
    assert found == [*bend_range(12.5, 3), *bend_range(12.5, 0), NoteOn(50, 90), NoteOn(52, 90, 3)]
    found = read(WIDE.model_copy(update={"mode": "mpe"}), first, two)
    assert found == [*bend_range(12.5, 0), *bend_range(48, 3), NoteOn(50, 90), NoteOn(52, 90, 3)]
    found = read(NARROW, first, *own_range, *turned)
    before = [*bend_range(2, 0), *bend_range(2, 1), NoteOn(50, 90), *bend_range(24, 1)]
    assert found == [*before, *bend_range(12.5, 0), *bend_range(5, 0), *bend_range(5, 1)]
    found = read(NARROW, TimedEvent(0.0, NoteOn(50, 90, 1)), *own_range, *let_go)
    at_rest = [ControlChange(121, 0, 1), *bend_range(2, 1), ControlChange(7, 100, 1), ControlChange(123, 0, 1)]
    assert found[-len(at_rest) :] == at_rest


# Songs


def notes_of(song: SongPart) -> list[tuple[int, int]]:
    return [(each.event.key, each.event.channel) for each in song.events if isinstance(each.event, NoteOn)]


A, DRUM, OTHER = (60, 0), (36, 9), (62, 1)
GUITAR, MPE = (INSTRUMENT.model_copy(update={"mode": mode}) for mode in ("guitar", "mpe"))
FEW_KEYS = NARROW.model_copy(update={"range": (40, 76)})
PADS, TUNED = (read_instrument(SHIPPED / f"{name}.json") for name in ("concert_toms", "tuned_toms"))
NO_DRUMS = "song.mid is played without its drums (channel 10)"


@pytest.mark.parametrize(
    ("notes", "instrument", "kept", "left_out"),
    [
        ([A], None, [A], ""),
        ([A, DRUM, OTHER], None, [A, OTHER], NO_DRUMS),
        ([OTHER, DRUM], MPE, [OTHER, DRUM], ""),  # there channel 10 is a member
        ([(60, 3), (64, 3), DRUM], GUITAR, [(60, KEYS), (64, KEYS)], NO_DRUMS),  # one channel is no guitar's
        ([(60, 3), (64, 3), DRUM], None, [(60, 3), (64, 3)], NO_DRUMS),
        ([(60, 3), (64, 0)], GUITAR, [(60, 3), (64, 0)], ""),
        ([A], FEW_KEYS, [A], ""),
        ([(38, 9), A, (40, 9)], PADS, [(38, 9), (40, 9)], "song.mid is played without its other channels (1)"),
        ([(38, 9), A, (40, 9)], TUNED, [A], NO_DRUMS),
        (
            [(10, 0), A, (120, 0), DRUM],
            FEW_KEYS,
            [(10, 0), A, (120, 0)],
            f"{NO_DRUMS} and 2 of its 3 notes, for which test has no string (E2 to E5)",
        ),
    ],
)
def test_a_song_is_its_notes_and_what_is_left_out(file, notes, instrument, kept, left_out):
    timed: list[TimedEvent] = []
    for place, (key, channel) in enumerate(notes):
        timed += [TimedEvent(0.5 * place, each) for each in (NoteOn(key, 90, channel), ControlChange(64, 9, channel))]
    file.write_bytes(midi_bytes(timed))
    found = read_song(file, instrument)
    assert (notes_of(found), found.left_out) == (kept, left_out)
    assert channels_in(each.event for each in found.events) == {channel for _, channel in kept}


def test_what_a_song_is_played_without_is_reported_once_with_a_command_that_quotes_its_name(tmp_path):
    file = tmp_path / 'a"$(b);c.mid'
    for pressure in (b"\0\xd0\x40", b"\0\xa0\x3c\x40"):
        file.write_bytes(one_track(pressure, ON))
        assert read_song(file, None).left_out == f"{file.name} is played without its pressure"
    odd = (*[b"\0\xc0\x05"] * 3, *[b"\0\xb0\x0a\x40"] * 2, b"\0\xb0\x40\x00", b"\0\xb0\x5b\x40", b"\0\x90\x3c\xff")
    file.write_bytes(one_track(*odd, b"\0\xb0\xff\x40", header=b"\0\1\0\2\0\x60"))
    words, _, command = read_song(file, None).left_out.rpartition(": ")
    assert words == (
        f"{file.name} is played without 1 track that its header counts; "
        "1 message of a key or a controller above 127; what exceeds 127 in 1 message; "
        "its program changes and its controllers 10, 91. Each channel with its own instrument"
    )
    assert shlex.split(command) == ["learned-strings", "play", file.name, "--out", "OUT.wav"]


def program(number: int, channel: int = 0, ticks: int = 0) -> bytes:
    return bytes((ticks, 0xC0 + channel, number - 1))


def on(key: int, channel: int = 0, ticks: int = 0) -> bytes:
    return bytes((ticks, 0x90 + channel, key, 64))


def test_programs_choose_the_factory_instrument_of_each_channel(file):
    assert {len(files) for files in FAMILIES.values()} == {8} and len(FAMILIES) == 16
    assert {name for files in FAMILIES.values() for name in files} <= {"", *(path.stem for path in SHIPPED.iterdir())}
    first = (program(25), program(33, 1), on(60), on(48, 1), on(64, 3), on(38, 9), on(80, 9), b"\0\xb0\x5b\x40")
    later = (program(47, ticks=48), on(62), program(49, ticks=48), on(64), b"\x60\x80\x3c\x40", b"\0\xb0\x40\x7f")
    file.write_bytes(one_track(*first, *later))
    parts, left_out = read_parts(file)
    assert left_out == "song.mid is played without its controller 91"
    assert [(part.words, instrument.name, [key for key, _ in notes_of(part)]) for instrument, part in parts] == [
        ("channel 1, program 25 (guitar)", "Classical guitar", [60]),
        ("channel 1, program 47 (strings), program 49 (ensemble; no such instrument)", "Concert harp", [62, 64]),
        ("channel 2, program 33 (bass)", "Upright bass", [48]),
        ("channel 4", "Classical guitar", [64]),
        ("channel 10, drums", "Concert toms", [38, 80]),
    ]
    for _, part in parts[:2]:
        assert [each.event for each in part.events][-2:] == [NoteOff(60), ControlChange(64, 127)]
    missing = "1 of its 2 notes, for which Concert toms has no drum (C2 to D♯3)"
    line = f"song.mid, channel 10, drums, is played without {missing}"
    assert [part.left_out for _, part in parts] == ["", "", "", "", line]
    file.write_bytes(one_track(on(60), program(47)))
    assert [instrument.name for instrument, _ in read_parts(file)[0]] == ["Concert harp"], (
        "of one time, in whichever order"
    )


# What cannot be read


@pytest.mark.parametrize(
    ("raw", "reported"),
    [
        (b"x", "no MIDI file"),
        (b"RIFF....WAVE", "no MIDI file"),
        (b"RIFF\x24\0\0\0WAVEfmt ", "another kind of RIFF"),
        (b"RIFF\x0c\0\0\0RMIDLIST\0\0\0\0", "no chunk of data"),
        (WHOLE[:40], "no MIDI file"),
        (b"MThd\0\0\0\2\0\0", "header"),
        (midi_bytes([]), "no note"),
        (WHOLE[:12] + b"\xd0\x28" + WHOLE[14:], "frames at a rate"),
        (WHOLE[:12] + b"\xe7\x00" + WHOLE[14:], "frames at a rate"),
        (WHOLE[:12] + b"\0\0" + WHOLE[14:], "division of 0"),
        (midi_bytes([TimedEvent(4000.0, NoteOn(1, 1))]), "an hour"),
        (midi_bytes([TimedEvent(0.0, NoteOn(36, 90, 9))]), "only drums"),
        (chunk(b"MThd", b"\0\2\0\2\0\x60") + 2 * chunk(b"MTrk", ON), "2 songs of their own"),
        (one_track(b"\0\x3c\x40"), "the kind of a message"),
        (one_track(b"\0\x90\x3c"), "within a message"),
        (one_track(b"\xff\xff\xff\xff\x7f\x90\x3c\x40"), "has no end"),
        (bytes(5 * 2**20), "4 MiB"),
        (b"", "cannot be read"),  # it is not there
        (None, "not an ordinary file; give another MIDI file"),
    ],
)
def test_a_file_that_cannot_be_played_is_named(file, raw, reported):
    if raw is None:
        file.mkdir()
    elif raw:
        file.write_bytes(raw)
    with pytest.raises(MidiFileError, match=reported) as caught:
        read_song(file, None)
    assert str(file) in str(caught.value) and "\n" not in str(caught.value)


def test_a_file_of_too_many_messages_is_refused():
    with pytest.raises(NotMidi, match=r"more than [0-9,]+ m"):
        read_messages(one_track(*[ON] * (MOST + 1)), MOST)
