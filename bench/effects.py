"""Body and room: their share of a core, and the slowest quantum.

Costs are processor time of this thread, less that of a mixer without effects. The worst quantum is the slowest place
within two of the convolver's windows, by the median over all pairs of windows, on which other processes have little
effect.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.machine import RATE_HZ
from engine.effects import Body, Effects
from engine.kernels.constants import QUANTUM
from engine.kernels.mixer_records import WINDOW, WINDOW_QUANTA
from engine.values.effects import Room
from engine.voices import Mixer, Voice, plain_program
from training.cli.console import ProgressReport

SECONDS = 10.0  # measured, after `FILLING_S`
FILLING_S = 6.5  # until the longest response is full of sound
CHOICES = {
    "body": Effects(Body(0.8)),
    "room of 0.5 s": Effects(room=Room(0.2, 0.5)),
    "room of 1.5 s": Effects(room=Room(0.2, 1.5)),
    "body, room of 1.5 s": Effects(Body(0.8), Room(0.2, 1.5)),
    "body, room of 3 s": Effects(Body(0.8), Room(0.2, 3.0)),
}


@dataclass(frozen=True)
class EffectsCost:
    """The cost of one choice of body and room.

    Attributes:
        share: of a core, while there is sound.
        worst_us, quantum_us: the time of the slowest quantum, and the duration of a quantum's sound.
    """

    name: str
    response_s: float
    share: float
    worst_us: float
    quantum_us: float


def measure(report: ProgressReport) -> dict[str, Any]:
    """Measure body and rooms."""
    costs = []
    empty_us = float(np.median(_quanta_us(None)))
    quantum_us = 1e6 * QUANTUM / RATE_HZ
    for number, (name, effects) in enumerate(CHOICES.items()):
        report(number / len(CHOICES), name)
        quanta_us = _quanta_us(effects) - empty_us
        period = 2 * WINDOW_QUANTA
        places = np.median(quanta_us[: len(quanta_us) // period * period].reshape(-1, period), axis=0)
        share, worst_us = float(np.mean(places)) / quantum_us, float(places.max())
        costs.append(EffectsCost(name, effects.tail_s(RATE_HZ), share, worst_us, quantum_us))
    return {"effects": tuple(costs)}


def _quanta_us(effects: Effects | None) -> NDArray[np.float64]:
    """Times of each quantum of noise."""
    mixer = Mixer(RATE_HZ)
    mixer.set_effects(effects)
    frames = round((SECONDS + FILLING_S) * RATE_HZ)
    noise = np.random.default_rng(0).uniform(-0.1, 0.1, (frames, 2)).astype(np.float32)
    voice = Voice.of_samples(plain_program(RATE_HZ), noise)
    voice.sound_through_effects()
    mixer.add(voice)
    mixer.render(round(FILLING_S * RATE_HZ) // WINDOW * WINDOW)
    found = []
    for _ in range(round(SECONDS * RATE_HZ) // QUANTUM):
        began_ns = time.thread_time_ns()
        mixer.render(QUANTUM)
        found.append((time.thread_time_ns() - began_ns) / 1000)
    return np.array(found)
