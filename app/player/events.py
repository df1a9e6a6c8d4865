"""The actions of a player, as values. Keys are MIDI keys, 0 … 127; channels are MIDI's, counted from 0, or `KEYS`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from app.instruments.fields import ranged
from app.instruments.instrument import Instrument
from app.shared.value import Value
from engine.kernels import midi
from engine.pluck import Pluck

# how keys are played
SWITCHES = (midi.LEGATO, midi.PORTAMENTO, midi.SLIDE_TIME, midi.HARMONICS, midi.TREMOLO, midi.STRUM)
SETS_PARAMETER = (midi.VALUE, midi.FINE_VALUE, midi.INCREMENT, midi.DECREMENT)
AT_REST = 127  # value of `RESET` with which nothing stays, of what MIDI's own, 0, leaves: ranges, tuning, volume
_PARAMETER = "chooses or sets a parameter, as the bend range"
_FIXED = {  # functions of controllers that no instrument changes; those from 120 on are MIDI's channel mode messages
    midi.SUSTAIN: "is the sustain pedal",
    midi.SLIDE_TIME: "is the time of slides",
    midi.PORTAMENTO: "lets legato slide",
    midi.SOFT: "is the palm mute",
    midi.LEGATO: "is the legato footswitch",
    midi.HARMONICS: "is the footswitch of harmonics",
    midi.TREMOLO: "is the footswitch of tremolo",
    midi.STRUM: "is the footswitch of strums",
    **dict.fromkeys(SETS_PARAMETER, _PARAMETER),
    **dict.fromkeys((midi.REGISTERED, midi.FINE_REGISTERED, midi.OTHER, midi.FINE_OTHER), _PARAMETER),
    **dict.fromkeys(range(midi.SOUND_OFF, 128), "stops or resets what is played"),
}
BEND_STEPS = 8_192  # of MIDI's pitch wheel, from rest to an end
NOTE_OFF, NOTE_ON, KEY_PRESSURE, CONTROLLER, PROGRAM, PRESSURE, BEND = range(0x80, 0xF0, 0x10)  # kinds of messages
LONGEST_RECORDING = 100_000  # events
TEMPOS_BPM = 30, 300  # the slowest and the fastest
EARLY_S = 0.12  # before the first beat: keys struck in this last part of the count-in are kept
KEYS = 16  # what is played on the computer's keys and on the screen: no channel of MIDI's
Number = Annotated[int, ranged(0, 127)]  # of MIDI
Channel = Annotated[int, ranged(0, KEYS)]
Side = Annotated[float, ranged(-2, 2)]  # in half-lengths of a drum, which a blow may miss


@dataclass(frozen=True)
class NoteOn:
    """A key is struck; velocity 1 … 127 (0 is a release).

    Attributes:
        place: where a drum is struck, from its centre in half-lengths, x and y; None: at its own place.
        pluck: by hand; None: as the instrument and the velocity have it.
            The string rings until the key is released, and no key is down.
        string: on which string of a set, from the highest, 0; None: the channel or the key chooses.
    """

    key: Number
    velocity: Number
    channel: Channel = 0
    place: tuple[Side, Side] | None = None
    string: Number | None = None
    pluck: Pluck | None = None


@dataclass(frozen=True)
class NoteOff:
    """A key is released; with `string`, only on that string."""

    key: Number
    channel: Channel = 0
    string: Number | None = None


@dataclass(frozen=True)
class Bend:
    """The pitch wheel moves to -1 … 1, in ranges of the channel.

    The range is the instrument's, unless messages set another (RPN 0).
    """

    value: Annotated[float, ranged(-1, 1)]
    channel: Channel = 0


@dataclass(frozen=True)
class ControlChange:
    """A controller moves to 0 … 127."""

    number: Number
    value: Number
    channel: Channel = 0


@dataclass(frozen=True)
class InstrumentTurned:
    """A knob was turned, or another instrument chosen."""

    instrument: Instrument


@dataclass(frozen=True)
class PluckAt:
    """The string that is shown is plucked by itself, without its instrument: what single strings play."""

    pluck: Pluck


def fixed_function(number: int) -> str:
    """The function of a controller in every instrument, as "is the sustain pedal"; "": it may be assigned."""
    return _FIXED.get(number, "")


def is_obeyed(number: int) -> bool:
    """Return True if a controller does anything without being assigned."""
    return bool(fixed_function(number)) or number in (midi.MOD_WHEEL, midi.VOLUME, midi.EXPRESSION, midi.SLIDE)


def moves_effects(event: object, instrument: Instrument) -> bool:
    """Return True if an event changes an instrument's body or room."""
    if isinstance(event, ControlChange):
        return event.number in (midi.MOD_WHEEL, midi.RESET) and instrument.mod_wheel.startswith(("body.", "room."))
    return isinstance(event, InstrumentTurned)


Event = NoteOn | NoteOff | Bend | ControlChange | InstrumentTurned | PluckAt


def event_of(message: Sequence[int]) -> Event | None:
    """The event of a whole message of MIDI, by its bytes; None for kinds that no instrument plays."""
    if len(message) < 3:
        return None
    kind, channel = message[0] & 0xF0, message[0] & 0x0F
    first, second = message[1] & 0x7F, message[2] & 0x7F
    if kind == NOTE_ON and second > 0:
        return NoteOn(first, second, channel)
    if kind in (NOTE_ON, NOTE_OFF):
        return NoteOff(first, channel)
    if kind == BEND:
        steps = first + 128 * second - BEND_STEPS
        return Bend(steps / BEND_STEPS if steps < 0 else steps / (BEND_STEPS - 1), channel)
    if kind == CONTROLLER:
        return ControlChange(first, 0 if first == midi.RESET else second, channel)
    return None


def message_of(event: Event) -> list[int]:
    """The bytes of an event as a MIDI message, the reverse of `event_of`; empty where MIDI has none for it.

    An event on KEYS is sent on channel 0.
    """
    if isinstance(event, InstrumentTurned | PluckAt):
        return []
    channel = 0 if event.channel == KEYS else event.channel % 16
    if isinstance(event, NoteOn):
        return [NOTE_ON + channel, event.key, event.velocity]
    if isinstance(event, NoteOff):
        return [NOTE_OFF + channel, event.key, 64]
    if isinstance(event, Bend):
        steps = round(event.value * (BEND_STEPS if event.value < 0 else BEND_STEPS - 1)) + BEND_STEPS
        return [BEND + channel, steps % 128, steps // 128]
    return [CONTROLLER + channel, event.number, 0 if event.number == midi.RESET else event.value]


def channels_in(events: Iterable[Event]) -> set[int]:
    """The channels that events come on."""
    return {event.channel for event in events if not isinstance(event, InstrumentTurned | PluckAt)}


def release_all(channels: Iterable[int]) -> list[Event]:
    """Events that leave channels as if nobody had played on them: pedal up, wheels at rest, no key held."""
    events: list[Event] = []
    for channel in sorted(channels):
        events += [ControlChange(midi.SUSTAIN, 0, channel), Bend(0.0, channel)]
        events += [ControlChange(midi.RESET, AT_REST, channel), ControlChange(midi.NOTES_OFF, 0, channel)]
    return events


def parameter_set(number: int, value: int, fine_value: int, channel: int) -> list[Event]:
    """The events that set a registered parameter of a channel, and then choose none.

    Args:
        number: of the parameter, as BEND_RANGE.
        value, fine_value: the upper and the lower seven bits.
    """
    messages = (
        (midi.REGISTERED, 0),
        (midi.FINE_REGISTERED, number),
        (midi.VALUE, value),
        (midi.FINE_VALUE, fine_value),
        (midi.REGISTERED, midi.NO_PARAMETER),
        (midi.FINE_REGISTERED, midi.NO_PARAMETER),
    )
    return [ControlChange(controller, byte, channel) for controller, byte in messages]


def bend_range(semitones: float, channel: int) -> list[Event]:
    """The events that set the range of a channel's bends."""
    return parameter_set(midi.BEND_RANGE, *divmod(round(100 * semitones), 100), channel)


def releases_for(events: Iterable[Event]) -> list[Event]:
    """The events that release the keys and pedals that are down after these events.

    A key that was struck twice without a release gets two; on a string of its own it gets one.
    """
    down: dict[NoteOff | ControlChange, int] = {}  # strokes without a release, in the order of the latest
    for event in events:
        if isinstance(event, NoteOn | NoteOff):
            off = NoteOff(event.key, event.channel, event.string)
            strokes = down.pop(off, 0)
            begins = isinstance(event, NoteOn) and event.velocity > 0
            strokes = (1 if event.string is not None else strokes + 1) if begins else strokes - 1
            if strokes > 0:
                down[off] = strokes
        elif isinstance(event, ControlChange) and event.number == midi.SUSTAIN:
            up = ControlChange(midi.SUSTAIN, 0, event.channel)
            down.pop(up, None)
            if event.value >= midi.PEDAL_DOWN:
                down[up] = 1
    return [event for event, count in down.items() for _ in range(count)]


@dataclass(frozen=True)
class TimedEvent:
    """An event and its time from the beginning."""

    time_s: float
    event: Event


class Meter(Value):
    """The counting of a recording.

    Attributes:
        beats: of a bar.
        metronome: whether it clicks while it is recorded.
    """

    tempo_bpm: int = Field(120, ge=TEMPOS_BPM[0], le=TEMPOS_BPM[1])
    beats: int = Field(4, ge=1, le=12)
    count_in_bars: int = Field(0, ge=0, le=2)
    metronome: bool = False

    @property
    def count_in_beats(self) -> int:
        return self.count_in_bars * self.beats


def played_from(recorded: Iterable[TimedEvent], end_s: float, counted: bool = False) -> list[TimedEvent]:
    """The events until `end_s`, with times in s from the first note on; empty where there was no note.

    Keys and pedals that are down are released at its end.

    Args:
        counted: times are from the first beat, which is at 0. Of what came before it, keys count that were struck
            less than EARLY_S too early, and wheels, pedals and knobs as they stand.
    """
    events = [timed_event for timed_event in recorded if timed_event.time_s <= end_s]
    events.sort(key=lambda timed_event: timed_event.time_s)
    if counted:
        turned_s = [
            entry.time_s for entry in events if entry.time_s < 0 and isinstance(entry.event, InstrumentTurned)
        ]
        from_s = {InstrumentTurned: max(turned_s, default=0.0), NoteOn: -EARLY_S, NoteOff: -EARLY_S}
        events = [entry for entry in events if entry.time_s >= from_s.get(type(entry.event), -math.inf)]
    events += [TimedEvent(end_s, event) for event in releases_for(timed_event.event for timed_event in events)]
    first = next((timed_event.time_s for timed_event in events if isinstance(timed_event.event, NoteOn)), None)
    if first is None:
        return []
    begin_s = 0.0 if counted else first
    return [TimedEvent(max(0.0, timed_event.time_s - begin_s), timed_event.event) for timed_event in events]
