"""The test piece as a list of events.

Its velocities are among those of the computer's digits, so that keys and MIDI can play the same.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from random import Random

from app.instrument.events import SUSTAIN, Bend, Controller, Event, NoteOff, NoteOn, TimedEvent

QUIET, MIDDLE, HARD, HARDEST = 17, 64, 96, 111  # the digits 2, 5, 7, 8
SINGLES = 30
LOWEST, HIGHEST = 36, 77  # of the computer's keys, an octave down and up
MELODY = (40, 45, 52, 48, 50, 55, 57, 59, 60, 64, 62, 65, 67, 69, 72, 76)
CHORDS = ((48, 52, 55, 59), (48, 52, 55, 57), (48, 52, 53, 57), (50, 53, 55, 59))  # no tone is a partial of another
REPEATED, REPEATS, REPEATS_A_SECOND = 52, 24, 12
BENT, BEND_STEPS = 57, 50
BENDS = (0.0, 1.0, -1.0, 0.5, 0.0)  # of the wheel's range; it rests at each
MOVES_S, RESTS_S = 0.3, 0.6
PEDALLED, RESTRUCK = 50, 52
RESTRIKES = 6


@dataclass(frozen=True)
class Part:
    """Events of a part, in order, with times from its beginning; `seconds`: until all of it has ended."""

    name: str
    events: tuple[TimedEvent, ...]
    seconds: float

    @property
    def turns(self) -> bool:
        """Whether it needs a wheel or a pedal."""
        return any(isinstance(each.event, Bend | Controller) for each in self.events)


def parts(random: Random, low: int, high: int) -> tuple[Part, ...]:
    """The whole piece, with the keys from `low` to `high` of the patch."""
    return (singles(random), melody(low, high), chords(), repeats(), bends(), pedal())


def singles(random: Random) -> Part:
    """Single notes out of silence, at random offsets from the device's blocks."""
    found, now_s = [], 0.0
    for _ in range(SINGLES):
        now_s += 0.8 + random.uniform(0, 0.1)
        found += _note(random.randint(48, 64), HARD, now_s, now_s + 0.15)
    return _part("singles", found, now_s + 1.0)


def melody(low: int, high: int) -> Part:
    """Quiet notes over the range, one after the other."""
    keys = [key for key in MELODY if max(low, LOWEST) <= key <= min(high, HIGHEST)]
    found = [
        event for number, key in enumerate(keys) for event in _note(key, QUIET, 1.5 * number, 1.5 * number + 1.0)
    ]
    return _part("melody", found, 1.5 * len(keys))


def chords() -> Part:
    found = [
        event
        for number, chord in enumerate(CHORDS)
        for key in chord
        for event in _note(key, MIDDLE, 1.6 * number, 1.6 * number + 1.2)
    ]
    return _part("chords", found, 1.6 * len(CHORDS))


def repeats() -> Part:
    """One key, repeated as fast as a player can."""
    step_s = 1 / REPEATS_A_SECOND
    found = [
        event
        for number in range(REPEATS)
        for event in _note(REPEATED, HARD, number * step_s, (number + 0.4) * step_s)
    ]
    return _part("repeats", found, REPEATS * step_s + 0.8)


def bends() -> Part:
    """A note that is held while the wheel moves and rests."""
    found: list[TimedEvent] = []
    now_s = RESTS_S
    for before, after in itertools.pairwise(BENDS):
        for step in range(1, BEND_STEPS + 1):
            share = step / BEND_STEPS
            found.append(TimedEvent(now_s + share * MOVES_S, Bend(before + share * (after - before))))
        now_s += MOVES_S + RESTS_S
    return _part("bends", [*_note(BENT, MIDDLE, 0.0, now_s), *found], now_s + 0.8)


def pedal() -> Part:
    """A note that a finger holds and the same held by the pedal; then soft strikes of a string that rings loudly."""
    found = _note(PEDALLED, MIDDLE, 0.0, 1.5)
    found += [_pedal(2.3, True), *_note(PEDALLED, MIDDLE, 2.4, 2.6), _pedal(3.9, False)]
    found += [_pedal(5.0, True), *_note(RESTRUCK, HARDEST, 5.1, 5.2)]
    for number in range(RESTRIKES):
        found += _note(RESTRUCK, QUIET, 5.5 + number / 8, 5.53 + number / 8)
    return _part("pedal", [*found, _pedal(6.5, False)], 7.3)


@dataclass(frozen=True)
class Sounded:
    """A note as it was played, with times in s; it is damped when neither finger nor pedal holds it any more."""

    key: int
    velocity: int
    pressed_s: float
    released_s: float
    damped_s: float


def sounded(played: Sequence[TimedEvent]) -> list[Sounded]:
    """The notes of a part's events."""
    end_s = max((each.time_s for each in played), default=0.0)
    found = []
    for place, each in enumerate(played):
        if not isinstance(each.event, NoteOn):
            continue
        released_s = _first(played[place:], each.event.key, end_s)
        down = [
            one.event.value > 0
            for one in played
            if isinstance(one.event, Controller) and one.event.number == SUSTAIN and one.time_s <= released_s
        ]
        damped_s = released_s
        if down and down[-1]:
            damped_s = next(
                (
                    one.time_s
                    for one in played
                    if one.time_s > released_s and isinstance(one.event, Controller) and one.event.value == 0
                ),
                end_s,
            )
        found.append(Sounded(each.event.key, each.event.velocity, each.time_s, released_s, damped_s))
    return found


def _first(played: Sequence[TimedEvent], key: int, otherwise_s: float) -> float:
    """When a key is released."""
    return next(
        (each.time_s for each in played if isinstance(each.event, NoteOff) and each.event.key == key), otherwise_s
    )


def _note(key: int, velocity: int, begins_s: float, ends_s: float) -> list[TimedEvent]:
    return [TimedEvent(begins_s, NoteOn(key, velocity)), TimedEvent(ends_s, NoteOff(key))]


def _pedal(time_s: float, down: bool) -> TimedEvent:
    return TimedEvent(time_s, Controller(SUSTAIN, 127 if down else 0))


def _part(name: str, events: Sequence[TimedEvent], seconds: float) -> Part:
    return Part(name, tuple(sorted(events, key=_order)), seconds)


def _order(each: TimedEvent) -> tuple[float, bool]:
    """A sort key: at the same time, ends come before beginnings."""
    event: Event = each.event
    return each.time_s, isinstance(event, NoteOn)
