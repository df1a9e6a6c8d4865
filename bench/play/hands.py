"""Simulated playing: random keys of the computer, repeatable by a seed."""

from __future__ import annotations

import time
from collections.abc import Sequence
from random import Random

from app.instruments.drums import Drums
from app.instruments.instrument import Instrument
from bench.play.screen import Screen

KEYS = ("a", "w", "s", "e", "d", "f", "t", "g", "y", "h", "u", "j", "k", "o", "l", "p", "semicolon")
ROW = ("a", "s", "d", "f", "g", "h", "j", "k", "l", "semicolon")  # places along a single string
LOWEST = 48  # the MIDI key that the first of them plays
OCTAVE_DOWN, OCTAVE_UP = "z", "x"
HELD_S = 0.03
SHORTEST_STEP_S = 0.04


def octave_of(instrument: Instrument | str) -> int:
    """The octave of the computer's keys in which most of them sound, the nearest to 0; of a preset's string 0."""
    if isinstance(instrument, str):
        return 0
    return max(range(-LOWEST // 12, 5), key=lambda octave: (len(_sounding(instrument, octave)), -abs(octave)))


def keys_of(instrument: Instrument | str) -> tuple[str, ...]:
    """The computer's keys that sound in that octave."""
    if isinstance(instrument, str):
        return ROW
    return tuple(KEYS[place] for place in _sounding(instrument, octave_of(instrument)))


def _sounding(instrument: Instrument, octave: int) -> list[int]:
    (low, high), drums = instrument.range, instrument.strings if isinstance(instrument.strings, Drums) else None
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


def steady(random: Random, rate_hz: float, seconds: float) -> list[float]:
    """Steps in s of so many plucks per second, each up to a tenth of a step early or late, as by a player."""
    step_s = max(1 / rate_hz, SHORTEST_STEP_S)
    offsets_s = [random.uniform(-0.1, 0.1) * step_s for _ in range(round(seconds / step_s))]
    return [step_s + offset - before for before, offset in zip([0.0, *offsets_s], offsets_s, strict=False)]
