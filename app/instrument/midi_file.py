"""MIDI files, through mido: read as events, and written from events."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from app.instrument.events import Bend, Controller, Event, NoteOff, NoteOn, PatchTurned, TimedEvent
from app.instrument.midi_chunks import check_chunks
from engine.plain_text import one_line
from engine.read_file import UnusableFile, read_bounded

LARGEST_BYTES = 2**20
MOST_EVENTS = 100_000
LONGEST_S = 3_600.0
TICKS, TEMPO = 960, 500_000  # of a quarter note; µs
BEND_STEPS = 8_192


class MidiFileError(ValueError):
    """A MIDI file cannot be read. The message names file, fault and remedy, in one line."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


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
        raw = read_bounded(path, LARGEST_BYTES)
        check_chunks(raw, MOST_EVENTS)
    except UnusableFile as error:
        raise MidiFileError(f"{path}: {error.strerror}; give a smaller MIDI file") from error
    except OSError as error:
        raise MidiFileError(f"{path}: cannot be read ({error.strerror}); check the name") from error
    except ValueError as error:
        raise MidiFileError(f"{path}: {error}; save it again as .mid, or give a shorter one") from error
    found: list[TimedEvent] = []
    time_s, messages = 0.0, 0
    try:
        song = mido.MidiFile(file=io.BytesIO(raw))
        if song.ticks_per_beat < 1:  # mido reads a count of frames as a negative number
            raise MidiFileError(f"{path}: counts frames, not beats (SMPTE); save it with ticks a beat")
        for message in song:
            time_s, messages = time_s + message.time, messages + 1
            if messages > MOST_EVENTS or not time_s <= LONGEST_S:
                told = f"more than {MOST_EVENTS} messages" if messages > MOST_EVENTS else "more than an hour of music"
                raise MidiFileError(f"{path}: {told}; give a shorter MIDI file")
            if not message.is_meta and (event := event_of(message)) is not None:
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

    if isinstance(event, PatchTurned):
        return
    channel = event.channel % 16
    if isinstance(event, NoteOn):
        yield mido.Message("note_on", note=event.key, velocity=event.velocity, channel=channel)
    elif isinstance(event, NoteOff):
        yield mido.Message("note_off", note=event.key, velocity=64, channel=channel)
    elif isinstance(event, Bend):
        steps = BEND_STEPS if event.value < 0 else BEND_STEPS - 1
        yield mido.Message("pitchwheel", pitch=round(event.value * steps), channel=channel)
    elif isinstance(event, Controller):
        yield mido.Message("control_change", control=event.number, value=event.value, channel=channel)
