"""Simulated playing: random keys of the computer, repeatable by a seed, or the events of a piece by keys or MIDI."""

from __future__ import annotations

import time
from collections.abc import Sequence
from random import Random
from typing import Protocol

from app.instrument.events import Event, NoteOff, NoteOn, TimedEvent
from app.patches.drums import Drums
from app.patches.instrument import Instrument, SingleString
from app.patches.patch import Patch
from tests.bench.play.midi import Cable
from tests.bench.play.screen import Screen

KEYS = ("a", "w", "s", "e", "d", "f", "t", "g", "y", "h", "u", "j", "k", "o", "l", "p", "semicolon")
ROW = ("a", "s", "d", "f", "g", "h", "j", "k", "l", "semicolon")  # places along a single string
LOWEST = 48  # the MIDI key that the first of them plays
OCTAVE_DOWN, OCTAVE_UP = "z", "x"
DIGITS = {round(1 + (digit - 1) / 8 * 126): str(digit) for digit in range(1, 10)}  # by the velocity that they set
HELD_S = 0.03
SHORTEST_STEP_S = 0.04


def octave_of(instrument: Instrument) -> int:
    """That to which the computer's keys are transposed so that most of them sound, the nearest to 0."""
    if isinstance(instrument, SingleString):
        return 0
    return max(range(-LOWEST // 12, 5), key=lambda octave: (len(_sounding(instrument, octave)), -abs(octave)))


def keys_of(instrument: Instrument) -> tuple[str, ...]:
    """The computer's keys that sound then."""
    if isinstance(instrument, SingleString):
        return ROW
    return tuple(KEYS[place] for place in _sounding(instrument, octave_of(instrument)))


def _sounding(patch: Patch, octave: int) -> list[int]:
    (low, high), drums = patch.range, patch.strings if isinstance(patch.strings, Drums) else None
    midi = [(place, LOWEST + 12 * octave + place) for place in range(len(KEYS))]
    return [place for place, key in midi if low <= key <= high and (drums is None or drums.of_key(key) is not None)]


def press(screen: Screen, key: str) -> None:
    """Press a key and release it at once."""
    screen.key(key, True)
    screen.key(key, False)


def tap(screen: Screen, key: str) -> float:
    """Press and release a key; return when it was pressed."""
    pressed_s = screen.key(key, True)
    time.sleep(HELD_S)
    screen.key(key, False)
    return pressed_s


def play(screen: Screen, random: Random, steps_s: Sequence[float], keys: Sequence[str] = KEYS) -> list[float]:
    """Tap random keys of these, `steps_s` apart; return when each was pressed."""
    pressed_s = []
    due_s = time.monotonic()
    for step_s in steps_s:
        due_s += step_s
        time.sleep(max(due_s - time.monotonic(), 0))
        pressed_s.append(tap(screen, random.choice(keys)))
    return pressed_s


def play_in_turn(screen: Screen, keys: Sequence[str], step_s: float) -> list[float]:
    """Tap these keys, `step_s` apart, each held for most of it; return when each was pressed."""
    pressed_s = []
    for key in keys:
        pressed_s.append(screen.key(key, True))
        time.sleep(0.8 * step_s)
        screen.key(key, False)
        time.sleep(0.2 * step_s)
    return pressed_s


def steady(random: Random, rate_hz: float, seconds: float) -> list[float]:
    """Steps in s of so many plucks per second, each up to a tenth of a step early or late, as by a player."""
    step_s = max(1 / rate_hz, SHORTEST_STEP_S)
    offsets_s = [random.uniform(-0.1, 0.1) * step_s for _ in range(round(seconds / step_s))]
    return [step_s + offset - before for before, offset in zip([0.0, *offsets_s], offsets_s, strict=False)]


class Hand(Protocol):
    """Plays events; `turns`: whether it has a wheel and a pedal."""

    turns: bool

    def do(self, event: Event) -> float:
        """Play an event; return when (`time.monotonic`)."""


class MidiHand:
    """Plays events through a MIDI cable."""

    turns = True

    def __init__(self, cable: Cable) -> None:
        self._cable = cable

    def do(self, event: Event) -> float:
        return self._cable.send(event)


class KeyHand:
    """Plays notes by the computer's keys, whose octave must be 0 at the start."""

    turns = False

    def __init__(self, screen: Screen) -> None:
        self._screen = screen
        self._octave = 0
        self._velocity: int | None = None
        self._down: dict[int, str] = {}

    def do(self, event: Event) -> float:
        """Raise ValueError for an event that the computer's keys cannot play."""
        if isinstance(event, NoteOff):
            return self._screen.key(self._down.pop(event.key), False)
        if not isinstance(event, NoteOn):
            raise ValueError("the computer's keys have neither wheel nor pedal")
        octave = self._octave
        while not 0 <= event.key - LOWEST - 12 * octave < len(KEYS):
            octave += 1 if event.key - LOWEST - 12 * octave > 0 else -1
        for _ in range(abs(octave - self._octave)):
            press(self._screen, OCTAVE_UP if octave > self._octave else OCTAVE_DOWN)
        if event.velocity != self._velocity:
            press(self._screen, DIGITS[event.velocity])
        self._octave, self._velocity = octave, event.velocity
        letter = self._down[event.key] = KEYS[event.key - LOWEST - 12 * octave]
        return self._screen.key(letter, True)


def perform(hand: Hand, events: Sequence[TimedEvent], seconds: float) -> list[TimedEvent]:
    """Play events at their times; return them with the times at which they were played (`time.monotonic`)."""
    began_s, played = time.monotonic(), []
    for each in events:
        time.sleep(max(began_s + each.time_s - time.monotonic(), 0))
        played.append(TimedEvent(hand.do(each.event), each.event))
    time.sleep(max(began_s + seconds - time.monotonic(), 0))
    return played
