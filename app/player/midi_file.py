"""MIDI files: read as events, and written from events, through mido."""

from __future__ import annotations

import contextlib
import io
import shlex
from collections import defaultdict, deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from app.instruments.drums import Drums
from app.instruments.instrument import Instrument
from app.instruments.library import FIRST, SHIPPED, SUFFIX, read_instrument
from app.player.compiled import is_another
from app.player.events import (
    AT_REST,
    CONTROLLER,
    KEY_PRESSURE,
    KEYS,
    PRESSURE,
    PROGRAM,
    SETS_PARAMETER,
    ControlChange,
    Event,
    InstrumentTurned,
    Meter,
    NoteOff,
    NoteOn,
    PluckAt,
    TimedEvent,
    bend_range,
    channels_in,
    event_of,
    is_obeyed,
    message_of,
)
from app.player.general_midi import DRUMS, KIT, instrument_of, program_words
from app.player.midi_messages import MidiMessages, NotMidi, read_messages
from app.player.strings import Strings
from app.shared.key_names import note_name
from engine.kernels.constants import USUAL_VOLUME
from engine.kernels.midi import RESET, VOLUME
from engine.plain_text import LineError
from engine.whole_file import UnusableFile, read_bounded

LARGEST_BYTES = 4 * 2**20
MOST_EVENTS = 400_000  # an hour of 50 notes a second, with releases
LONGEST_S = 3_600.0
AFTER_LAST_NOTE_S = 60.0  # events later than this after the last note are left out
TICKS, TEMPO = 960, 500_000  # of a quarter note; µs
MEMBER_SEMITONES = 48.0  # range of bends of MPE's members


class MidiFileError(LineError, ValueError):
    """A MIDI file cannot be read. The message names file, fault and remedy, in one line."""


@dataclass(frozen=True)
class SongPart:
    """The part of a MIDI file that an instrument plays.

    Attributes:
        left_out: what it does not play, in one line; "" for nothing.
        words: its channel and its programs, where it is one of several.
    """

    events: list[TimedEvent]
    left_out: str
    words: str = ""


def read_midi(path: Path) -> list[TimedEvent]:
    """The events of all tracks, in the order of their times in s, until a minute after the last note.

    Raises:
        MidiFileError: it is missing, damaged, too large or too long, or holds no note.
    """
    return _events_of(path, _messages_in(path))


def _messages_in(path: Path) -> MidiMessages:
    """The channel messages of a file. Raises MidiFileError: it cannot be read, or is no MIDI file."""
    try:
        return read_messages(read_bounded(path, LARGEST_BYTES), MOST_EVENTS)
    except UnusableFile as error:
        raise MidiFileError(f"{path}: {error.strerror}; give another MIDI file") from error
    except OSError as error:
        raise MidiFileError(f"{path}: cannot be read ({error.strerror}); check the name") from error
    except NotMidi as error:
        raise MidiFileError(f"{path}: {error}; save it again as .mid, or give a shorter one") from error


def _events_of(path: Path, messages: MidiMessages) -> list[TimedEvent]:
    """The events of the messages of a file, as `read_midi` returns them; `path` is for errors alone."""
    timed_events: list[TimedEvent] = []
    notes, last_note_s = False, 0.0
    for time_s, message in messages.timed:
        if (event := event_of(message)) is None:
            continue
        timed_events.append(TimedEvent(time_s, event))
        if isinstance(event, NoteOn | NoteOff):
            notes, last_note_s = notes or isinstance(event, NoteOn), time_s
    if not notes:
        raise MidiFileError(f"{path}: holds no note; give a MIDI file with notes")
    if not last_note_s <= LONGEST_S:
        raise MidiFileError(f"{path}: more than an hour of music; give a shorter MIDI file")
    while timed_events[-1].time_s > min(last_note_s + AFTER_LAST_NOTE_S, LONGEST_S):
        timed_events.pop()
    return timed_events


def _ignored_messages(messages: MidiMessages, follows_programs: bool = False) -> list[str]:
    """Phrases for the messages that change nothing; `follows_programs`: program changes do choose instruments."""
    left_out = []
    if messages.missing_tracks:
        left_out.append(f"{_count(messages.missing_tracks, 'track')} that its header counts")
    if messages.skipped:
        left_out.append(f"{_count(messages.skipped, 'message')} of a key or a controller above 127")
    if messages.clipped:
        left_out.append(f"what exceeds 127 in {_count(messages.clipped, 'message')}")
    kinds = {message[0] & 0xF0 for _, message in messages.timed}
    if PROGRAM in kinds and not follows_programs:
        left_out.append("its program changes")
    if kinds & {KEY_PRESSURE, PRESSURE}:
        left_out.append("its pressure")
    sent = {message[1] for _, message in messages.timed if message[0] & 0xF0 == CONTROLLER}
    if unknown := [str(number) for number in sorted(sent) if not is_obeyed(number)]:
        left_out.append(f"its controller{'s' if len(unknown) > 1 else ''} {', '.join(unknown)}")
    return left_out


def _count(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


def read_song(path: Path, instrument: Instrument | None) -> SongPart:
    """Read the events of a MIDI file that an instrument plays.

    Strings leave out drums, and drums on pads all else. Keys without sound are left out too.

    In MPE channel 10 is one as the others. In guitar mode a file whose notes are all on one channel is no guitar's,
    whichever channel that is: it plays any key.

    Raises:
        MidiFileError: as `read_midi`; or it holds only drums.
    """
    messages = _messages_in(path)
    part = _part(path, instrument, _events_of(path, messages), _ignored_messages(messages))
    if not any(message[0] & 0xF0 == PROGRAM for _, message in messages.timed):
        return part
    by_programs = f"Each channel with its own instrument: learned-strings play {shlex.quote(path.name)} --out OUT.wav"
    return replace(part, left_out=f"{part.left_out}. {by_programs}")


def read_parts(path: Path) -> tuple[list[tuple[Instrument, SongPart]], str]:
    """Read the parts of a MIDI file, one for each channel and each factory instrument that its programs choose.

    A program that no instrument is like leaves the channel's, which before the first is the app's first one. Channel
    10 plays drums.

    Returns:
        The instruments with their parts, and what none of them plays, in one line; "" for nothing.

    Raises:
        MidiFileError: as `read_midi`.
    """
    messages = _messages_in(path)
    timed = _events_of(path, messages)
    changes = deque((time_s, message) for time_s, message in messages.timed if message[0] & 0xF0 == PROGRAM)
    playing = dict.fromkeys(range(16), (FIRST.stem, "")) | {DRUMS: (KIT, "drums")}  # channel: file, words
    channels: dict[int, list[TimedEvent]] = defaultdict(list)
    notes: dict[tuple[int, str], dict[int, str]] = defaultdict(dict)  # by channel and file: place, program's words
    for entry in timed:
        while changes and changes[0][0] <= entry.time_s:
            status, program, _ = changes.popleft()[1]
            channel = status & 0x0F
            if channel != DRUMS:
                playing[channel] = instrument_of(program) or playing[channel][0], program_words(program)
        (channel,) = channels_in([entry.event])
        if isinstance(entry.event, NoteOn):
            name, words = playing[channel]
            notes[channel, name][len(channels[channel])] = words
        channels[channel].append(entry)
    parts = []
    for (channel, name), places in sorted(notes.items()):
        own = [
            entry
            for place, entry in enumerate(channels[channel])
            if place in places or not isinstance(entry.event, NoteOn)
        ]
        words = ", ".join(filter(None, (f"channel {channel + 1}", *dict.fromkeys(places.values()))))
        instrument = read_instrument(SHIPPED / f"{name}{SUFFIX}")
        parts.append((instrument, replace(_part(path, instrument, own, [], f", {words},"), words=words)))
    return parts, _left_out_words(path.name, _ignored_messages(messages, follows_programs=True))


def _part(
    path: Path, instrument: Instrument | None, timed: list[TimedEvent], ignored: list[str], words: str = ""
) -> SongPart:
    """The part of these events that an instrument plays; see `read_song`.

    Args:
        ignored: phrases for messages that change nothing.
        words: what follows the file's name in `left_out`.
    """
    mode = instrument.mode if instrument is not None else "poly"
    notes_on = {entry.event.channel for entry in timed if isinstance(entry.event, NoteOn)}
    pads = instrument is not None and isinstance(instrument.strings, Drums) and instrument.strings.keys == "pads"
    drums = set() if mode == "mpe" else notes_on & {DRUMS}
    if pads and drums:
        timed = [entry for entry in timed if channels_in([entry.event]) in (drums, set())]
        others = [f"its other channels ({len(notes_on) - 1})"] if len(notes_on) > 1 else []
        return _song(path.name + words, instrument, timed, others + ignored)
    channels = notes_on - drums
    if not channels:
        raise MidiFileError(f"{path}: holds only drums (channel 10); give a MIDI file with other notes")
    if drums:
        timed = [entry for entry in timed if channels_in([entry.event]) != drums]
    if mode == "guitar" and len(channels) == 1:
        timed = [
            replace(entry, event=_on_channel_of_keys(entry.event))
            for entry in timed
            if channels_in([entry.event]) == channels
        ]
    return _song(path.name + words, instrument, timed, (["its drums (channel 10)"] if drums else []) + ignored)


def _song(name: str, instrument: Instrument | None, timed: list[TimedEvent], left_out: list[str]) -> SongPart:
    """The song of these events.

    Args:
        left_out: phrases for what is not played; the number of notes without a sound is added.
    """
    keys = [entry.event.key for entry in timed if isinstance(entry.event, NoteOn)]
    if instrument is not None and (silent := _count_silent(instrument, keys)):
        low, high = (note_name(key) for key in instrument.range)
        sounding = "drum" if isinstance(instrument.strings, Drums) else "string"
        left_out.append(
            f"{silent} of its {len(keys)} notes, for which {instrument.name} has no {sounding} ({low} to {high})"
        )
    return SongPart(timed, _left_out_words(name, left_out))


def _left_out_words(name: str, left_out: list[str]) -> str:
    return f"{name} is played without {_join_words(left_out)}" if left_out else ""


def _join_words(words: Sequence[str]) -> str:
    return " and ".join(filter(None, ("; ".join(words[:-1]), words[-1])))


def _count_silent(instrument: Instrument, keys: Sequence[int]) -> int:
    """The number of these keys for which an instrument has no string."""
    strings, is_silent = Strings(instrument), dict.fromkeys(keys, False)
    for key in is_silent:
        with contextlib.suppress(ValueError):  # an impossible string is reported when it is struck
            is_silent[key] = strings.of_key(key) is None
    return sum(is_silent[key] for key in keys)


def _on_channel_of_keys(event: Event) -> Event:
    return event if isinstance(event, InstrumentTurned | PluckAt) else replace(event, channel=KEYS)


def midi_bytes(
    timed: Sequence[TimedEvent], instrument: Instrument | None = None, meter: Meter | None = None
) -> bytes:
    """The bytes of a MIDI file of one track. Times are rounded to 1/960 of a beat; turned knobs are left out.

    Args:
        instrument: with which it was played; each channel has its range of bends (RPN 0). None: no range is written.
        meter: its tempo and bars; None: 120 beats a minute, and no bars.
    """
    import mido

    if instrument is not None:
        timed = _with_ranges(timed, instrument)

    tempo = TEMPO if meter is None else mido.bpm2tempo(meter.tempo_bpm)
    track = mido.MidiTrack([mido.MetaMessage("set_tempo", tempo=tempo)])
    if meter is not None:
        track.append(mido.MetaMessage("time_signature", numerator=meter.beats, denominator=4))
    tick = 0
    for entry in sorted(timed, key=lambda timed_event: timed_event.time_s):
        if message := message_of(entry.event):
            now = max(tick, round(mido.second2tick(entry.time_s, TICKS, tempo)))
            track.append(mido.Message.from_bytes(message, time=now - tick))
            tick = now
    file = mido.MidiFile(type=0, ticks_per_beat=TICKS)
    file.tracks.append(track)
    buffer = io.BytesIO()
    file.save(file=buffer)
    return buffer.getvalue()


def _with_ranges(timed: Sequence[TimedEvent], instrument: Instrument) -> list[TimedEvent]:
    """The events, with messages that set the range of bends of each channel as the instrument has it.

    A channel whose own messages set a parameter is left alone from then on, until it is reset.
    """
    channels = sorted(channels_in(entry.event for entry in timed))
    with_own_range = set[int]()
    track = list[TimedEvent]()

    def set_ranges(time_s: float, of: Iterable[int]) -> None:
        for channel in of:
            member = instrument.mode == "mpe" and channel not in (0, KEYS)
            semitones = MEMBER_SEMITONES if member else instrument.bend_semitones
            track.extend(TimedEvent(time_s, event) for event in bend_range(semitones, channel))

    set_ranges(0.0, channels)
    for entry in sorted(timed, key=lambda timed_event: timed_event.time_s):
        event, time_s = entry.event, entry.time_s
        track.append(entry)
        if isinstance(event, InstrumentTurned):
            if is_another(event.instrument, instrument):
                with_own_range.clear()
            before, instrument = instrument, event.instrument
            range_changed = (before.bend_semitones, before.mode) != (instrument.bend_semitones, instrument.mode)
            set_ranges(time_s, [channel for channel in channels if range_changed and channel not in with_own_range])
        elif isinstance(event, ControlChange) and event.number in SETS_PARAMETER:
            with_own_range.add(event.channel)
        elif isinstance(event, ControlChange) and (event.number, event.value) == (RESET, AT_REST):
            with_own_range.discard(event.channel)
            set_ranges(time_s, [event.channel])
            track.append(TimedEvent(time_s, ControlChange(VOLUME, USUAL_VOLUME, event.channel)))
    return track
