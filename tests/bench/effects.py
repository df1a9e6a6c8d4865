"""Body and room: their share of a core, the slowest quantum, and the time to set them.

Costs are processor time of this thread, less that of a mixer without effects. The worst quantum is the slowest place
within two of the convolver's windows, by the median over all pairs of windows, on which other processes have little
effect.
"""

from __future__ import annotations

import itertools
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine.effects import Body, Effects
from engine.kernels.constants import QUANTUM
from engine.kernels.mixer_records import WINDOW, WINDOW_QUANTA
from engine.values.effects import Room
from engine.voices import Mixer, Voice, plain_program
from tests.bench.machine import Machine, one_thread

RATE_HZ = 48_000
SECONDS = 10.0  # measured, after `FILLING_S`
FILLING_S = 6.5  # until the longest response is full of sound
REPEATS = 7
CHOICES = {
    "body": Effects(Body(0.8)),
    "room of 0.5 s": Effects(room=Room(0.2, 0.5)),
    "room of 1.5 s": Effects(room=Room(0.2, 1.5)),
    "body, room of 1.5 s": Effects(Body(0.8), Room(0.2, 1.5)),
    "body, room of 3 s": Effects(Body(0.8), Room(0.2, 3.0)),
}
_NEW = itertools.count(1)
EXCHANGED = "body, room of 1.5 s"


@dataclass(frozen=True)
class EffectsCost:
    """The cost of one choice of body and room.

    Attributes:
        share: of a core, while there is sound.
        at_rest: of a core, after all sound has ended.
        worst_us, quantum_us: the time of the slowest quantum, and the duration of a quantum's sound.
        set_ms, first_ms: time of the caller that sets them, with a response that is cached and one that is not.
    """

    name: str
    response_s: float
    share: float
    at_rest: float
    worst_us: float
    quantum_us: float
    set_ms: float
    first_ms: float


@dataclass(frozen=True)
class EffectsBenchmark:
    machine: Machine
    rate_hz: int
    effects: tuple[EffectsCost, ...]


def measure(report: Callable[[float, str], None]) -> EffectsBenchmark:
    """Measure body and rooms, and one room that is exchanged without a pause."""
    with one_thread():
        costs = []
        names = [*CHOICES, f"{EXCHANGED}, exchanged"]
        for number, name in enumerate(names):
            report(number / len(names), name)
            costs.append(_cost(name, CHOICES.get(name, CHOICES[EXCHANGED]), name not in CHOICES))
        return EffectsBenchmark(Machine.here(), RATE_HZ, tuple(costs))


def _cost(name: str, effects: Effects, exchanged: bool) -> EffectsCost:
    empty_us = float(np.median(_quanta_us(None, False)))
    quanta_us = _quanta_us(effects, exchanged) - empty_us
    rest_us, nothing_us = (np.median(_quanta_us(choice, False, sounding=False)) for choice in (effects, None))
    quantum_us = 1e6 * QUANTUM / RATE_HZ
    period = 2 * WINDOW_QUANTA  # of an exchange: it is prepared in one window and fades in the next
    places = np.median(quanta_us[: len(quanta_us) // period * period].reshape(-1, period), axis=0)
    first_ms, set_ms = _setting_ms(effects)
    return EffectsCost(
        name,
        effects.tail_s(RATE_HZ),
        float(np.mean(places)) / quantum_us,
        float(rest_us - nothing_us) / quantum_us,
        float(places.max()),
        quantum_us,
        set_ms,
        first_ms,
    )


def _quanta_us(effects: Effects | None, exchanged: bool, sounding: bool = True) -> NDArray[np.float64]:
    """Times of each quantum of noise. `exchanged`: another response is set with each window."""
    mixer = Mixer(RATE_HZ)
    mixer.set_effects(effects)
    frames = round((SECONDS + FILLING_S) * RATE_HZ) if sounding else 64
    draw = np.random.default_rng(0)
    voice = Voice.of_samples(plain_program(RATE_HZ), draw.uniform(-0.1, 0.1, (frames, 2)).astype(np.float32))
    voice.sound_through_effects()
    mixer.add(voice)
    mixer.render(round(FILLING_S * RATE_HZ) // WINDOW * WINDOW)
    found = []
    for number in range(round(SECONDS * RATE_HZ) // QUANTUM):
        if exchanged and effects is not None and number % WINDOW_QUANTA == 0:
            room = effects.room or Room()
            mixer.set_effects(Effects(effects.body, Room(0.2 + 0.1 * (number // WINDOW_QUANTA % 2), room.t60_s)))
        began_ns = time.thread_time_ns()
        mixer.render(QUANTUM)
        found.append((time.thread_time_ns() - began_ns) / 1000)
    return np.array(found)


def _setting_ms(effects: Effects) -> tuple[float, float]:
    """Times to set responses that must be computed, and those that are cached and only mixed differently."""
    mixer = Mixer(RATE_HZ)
    first_ms: list[float] = []
    again_ms: list[float] = []
    for _ in range(REPEATS):
        new = next(_NEW) / 10_000
        body = effects.body and replace(effects.body, size=1 + new)
        room = effects.room and replace(effects.room, t60_s=effects.room.t60_s - new)
        for times_ms in (first_ms, again_ms):
            began_s = time.thread_time()
            mixer.set_effects(Effects(body, room))
            times_ms.append(1000 * (time.thread_time() - began_s))
            body, room = body and replace(body, mix=0.7), room and replace(room, mix=0.3)
    return statistics.median(first_ms), statistics.median(again_ms)
