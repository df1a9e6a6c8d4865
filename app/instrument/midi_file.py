"""MIDI files, through mido: read as events, and written from events."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from app.instrument.events import (
    KEYS,
    Bend,
    Controller,
    Event,
    NoteOff,
    NoteOn,
    PatchTurned,
    PluckAt,
    TimedEvent,
    channels_in,
)
from app.instrument.midi_chunks import checked_chunks
from app.instrument.strings import Strings
from app.patches.drums import Drums
from app.patches.patch import Patch
from app.shared.key_names import note_name
from engine.plain_text import one_line
from engine.read_file import UnusableFile, read_bounded

LARGEST_BYTES = 2**20
MOST_EVENTS = 80_000
LONGEST_S = 3_600.0
TICKS, TEMPO = 960, 500_000  # of a quarter note; µs
BEND_STEPS = 8_192
DRUMS = 9  # General MIDI's channel 10


class MidiFileError(ValueError):
    """A MIDI file cannot be read. The message names file, fault and remedy, in one line."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


@dataclass(frozen=True)
class Song:
    """What a patch plays of a MIDI file.

    Attributes:
        left_out: what it does not play, in one line; "" for nothing.
    """

    events: list[TimedEvent]
    left_out: str


def event_of(message: Any) -> Event | None:
    """The event of a message of mido's; None for kinds that no patch plays."""
    if message.type == "note_on":
        if message.velocity == 0:
            return NoteOff(message.note, message.channel)
        return NoteOn(message.note, message.velocity, message.channel)
    if message.type == "note_off":
        return NoteOff(message.note, message.channel)
    if message.type == "pitchwheel":
        return Bend(
            message.pitch / BEND_STEPS if message.pitch < 0 else message.pitch / (BEND_STEPS - 1), message.channel
        )
    if message.type == "control_change":
        return Controller(message.control, message.value, message.channel)
    return None


def read_midi(path: Path) -> list[TimedEvent]:
    """The events of all tracks, in the order of their times in s.

    Raises:
        MidiFileError: it is missing, damaged, too large or too long, or holds no note.
    """
    import mido

    try:
        raw = checked_chunks(read_bounded(path, LARGEST_BYTES), MOST_EVENTS)
    except UnusableFile as error:
        raise MidiFileError(f"{path}: {error.strerror}; give a smaller MIDI file") from error
    except OSError as error:
        raise MidiFileError(f"{path}: cannot be read ({error.strerror}); check the name") from error
    except ValueError as error:
        raise MidiFileError(f"{path}: {error}; save it again as .mid, or give a shorter one") from error
    found: list[TimedEvent] = []
    try:
        song = mido.MidiFile(file=io.BytesIO(raw))
        if song.ticks_per_beat < 1:  # mido reads a count of frames as a negative number
            raise MidiFileError(f"{path}: counts frames, not beats (SMPTE); save it with ticks a beat")
        for time_s, message in _in_time(song):
            if not time_s <= LONGEST_S:
                raise MidiFileError(f"{path}: more than an hour of music; give a shorter MIDI file")
            if (event := event_of(message)) is not None:
                found.append(TimedEvent(time_s, event))
    except MidiFileError:
        raise
    except Exception as error:  # mido raises many kinds for damaged files
        raise MidiFileError(
            f"{path}: is no MIDI file that can be read ({type(error).__name__}: {error}); save it again as .mid"
        ) from error
    if not any(isinstance(each.event, NoteOn) for each in found):
        raise MidiFileError(f"{path}: holds no note; give a MIDI file with notes")
    return found


def _in_time(song: Any) -> Iterator[tuple[float, Any]]:
    """The messages of all tracks in the order of their times, which are in s.

    mido's own way through a song copies each message three times, and takes twice as long.
    """
    import mido

    if song.type == 2:
        raise ValueError("its tracks are songs of their own (type 2)")
    ticked: list[tuple[int, Any]] = []
    for track in song.tracks:
        tick = 0
        for message in track:
            tick += message.time
            ticked.append((tick, message))
    ticked.sort(key=lambda each: each[0])  # of one time: in the order of the tracks
    time_s, before, tempo = 0.0, 0, TEMPO
    for tick, message in ticked:
        time_s += mido.tick2second(tick - before, song.ticks_per_beat, tempo)
        before = tick
        if message.type == "set_tempo":
            tempo = message.tempo
        yield time_s, message


def read_song(path: Path, patch: Patch | None) -> Song:
    """What a patch plays of a MIDI file: strings leave drums out, and drums on pads all else; and keys without sound.

    In MPE channel 10 is one as the others. In guitar mode a file whose notes are all on one channel is no guitar's,
    whichever channel that is: it plays any key.

    Raises:
        MidiFileError: as `read_midi`; or it holds only drums.
    """
    timed, mode = read_midi(path), patch.mode if patch is not None else "poly"
    notes_on = {each.event.channel for each in timed if isinstance(each.event, NoteOn)}
    pads = patch is not None and isinstance(patch.strings, Drums) and patch.strings.keys == "pads"
    drums = set() if mode == "mpe" else notes_on & {DRUMS}
    if pads and drums:
        timed = [each for each in timed if channels_in([each.event]) in (drums, set())]
        return _song(path, patch, timed, [f"its other channels ({len(notes_on) - 1})"] if len(notes_on) > 1 else [])
    if pads:
        drums = set()
    channels = notes_on - drums
    if not channels:
        raise MidiFileError(f"{path}: holds only drums (channel 10); give a MIDI file with other notes")
    if drums:
        timed = [each for each in timed if channels_in([each.event]) != drums]
    if mode == "guitar" and len(channels) == 1:
        timed = [replace(each, event=_on_keys(each.event)) for each in timed if channels_in([each.event]) == channels]
    return _song(path, patch, timed, ["its drums (channel 10)"] if drums else [])


def _song(path: Path, patch: Patch | None, timed: list[TimedEvent], left_out: list[str]) -> Song:
    """The song; `left_out` with the notes for which the patch has no sound."""
    keys = [each.event.key for each in timed if isinstance(each.event, NoteOn)]
    if patch is not None and (silent := _silent(patch, keys)):
        low, high = (note_name(key) for key in patch.range)
        sounding = "drum" if isinstance(patch.strings, Drums) else "string"
        left_out.append(
            f"{silent} of its {len(keys)} notes, for which {patch.name} has no {sounding} ({low} to {high})"
        )
    return Song(timed, f"{path.name} is played without {' and '.join(left_out)}" if left_out else "")


def _silent(patch: Patch, keys: Sequence[int]) -> int:
    """For how many of these keys a patch has no string."""
    strings, known = Strings(patch), dict.fromkeys(keys, False)
    for key in known:
        with contextlib.suppress(ValueError):  # an impossible string is reported when it is struck
            known[key] = strings.of_key(key) is None
    return sum(known[key] for key in keys)


def _on_keys(event: Event) -> Event:
    return event if isinstance(event, PatchTurned | PluckAt) else replace(event, channel=KEYS)


def midi_bytes(timed: Sequence[TimedEvent]) -> bytes:
    """The bytes of a MIDI file of one track; times are rounded to 1/1920 s, and changes of the patch left out."""
    import mido

    track = mido.MidiTrack([mido.MetaMessage("set_tempo", tempo=TEMPO)])
    tick = 0
    for each in sorted(timed, key=lambda one: one.time_s):
        now = round(mido.second2tick(each.time_s, TICKS, TEMPO))
        for message in messages_of(each.event):
            track.append(message.copy(time=max(0, now - tick)))
            tick = max(tick, now)
    file = mido.MidiFile(type=0, ticks_per_beat=TICKS)
    file.tracks.append(track)
    buffer = io.BytesIO()
    file.save(file=buffer)
    return buffer.getvalue()


def messages_of(event: Event) -> Iterable[Any]:
    """The mido messages of an event; none where MIDI has no message for it."""
    import mido

    if isinstance(event, PatchTurned | PluckAt):
        return
    channel = 0 if event.channel == KEYS else event.channel % 16
    if isinstance(event, NoteOn):
        yield mido.Message("note_on", note=event.key, velocity=event.velocity, channel=channel)
    elif isinstance(event, NoteOff):
        yield mido.Message("note_off", note=event.key, velocity=64, channel=channel)
    elif isinstance(event, Bend):
        steps = BEND_STEPS if event.value < 0 else BEND_STEPS - 1
        yield mido.Message("pitchwheel", pitch=round(event.value * steps), channel=channel)
    elif isinstance(event, Controller):
        yield mido.Message("control_change", control=event.number, value=event.value, channel=channel)
