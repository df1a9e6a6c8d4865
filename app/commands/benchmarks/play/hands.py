"""Keys as a player presses them: the letters of a piano's two rows, in a random but repeatable order."""

from __future__ import annotations

import time
from collections.abc import Sequence
from random import Random

from app.commands.benchmarks.play.screen import Screen

KEYS = ("a", "w", "s", "e", "d", "f", "t", "g", "y", "h", "u", "j", "k", "o", "l", "p", "semicolon")
HELD_S = 0.03
SHORTEST_STEP_S = 0.04


def tap(screen: Screen, key: str) -> float:
    """Presses a key and lets it go; returns when it was pressed."""
    pressed_s = screen.key(key, True)
    time.sleep(HELD_S)
    screen.key(key, False)
    return pressed_s


def play(screen: Screen, random: Random, steps_s: Sequence[float]) -> list[float]:
    """Taps a random key at each of the `steps_s` after the one before; returns the times."""
    pressed_s = []
    due_s = time.monotonic()
    for step_s in steps_s:
        due_s += step_s
        time.sleep(max(due_s - time.monotonic(), 0))
        pressed_s.append(tap(screen, random.choice(KEYS)))
    return pressed_s


def steady(random: Random, rate_hz: float, seconds: float) -> list[float]:
    """Steps of so many plucks a second, each up to a tenth of a step early or late, as hands are."""
    step_s = max(1 / rate_hz, SHORTEST_STEP_S)
    offsets_s = [random.uniform(-0.1, 0.1) * step_s for _ in range(round(seconds / step_s))]
    return [step_s + offset - before for before, offset in zip([0.0, *offsets_s], offsets_s, strict=False)]


def single(random: Random, count: int, step_s: float) -> list[float]:
    """Steps of single plucks, in no step with blocks."""
    return [step_s + random.uniform(0, 0.1) for _ in range(count)]
