"""A voice that reads samples which a thread renders ahead, converted to the device's rate by a windowed sinc."""

from __future__ import annotations

import numpy as np
from numba import carray, njit

from engine.kernels import layout as at
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import fence, pointer


@njit(**COMPILED)
def generate(voice: np.ndarray, program: np.ndarray, out: np.ndarray) -> None:
    """The next quantum, (4, QUANTUM). Where the samples are not there yet it fades out, stands still, and counts."""
    whole = program.view(np.int64)
    counts = voice.view(np.int64)
    taps, phases, ratio = whole[at.R_TAPS], whole[at.R_PHASES], program[at.R_RATIO]
    table = program[whole[at.R_FILTER] :]
    points = counts[at.POINTS]
    ready, length = counts[at.READY], counts[at.LENGTH]
    fence()
    samples = carray(pointer(counts[at.SAMPLES]), (length * points,), np.float32)
    first = counts[at.GENERATED]
    # of this quantum and the next, so that there is a quantum in which to fade out
    needed = int((first + 2 * at.QUANTUM) * ratio) + taps + 1
    dry = ready < length and ready < needed
    was_dry = counts[at.DRY]
    if dry and (was_dry or first == 0):
        counts[at.DRY] = 1
        out[:] = 0.0
        counts[at.STARVED] += at.QUANTUM
        return
    looped = counts[at.LOOPED]
    for frame in range(at.QUANTUM):
        place = float((first + frame) % length) if looped else (first + frame) * ratio
        before = int(place)
        phase = (place - before) * phases
        row = int(phase)
        share = phase - row
        gain = 1.0
        if dry:
            gain = 1.0 - (frame + 1) / at.QUANTUM
        elif was_dry:
            gain = (frame + 1) / at.QUANTUM
        low, high = table[row * 2 * taps :], table[(row + 1) * 2 * taps :]
        for point in range(points):
            total = 0.0
            for tap in range(2 * taps):
                index = abs(before - taps + 1 + tap)  # before the pluck lies its mirror
                if looped:
                    index %= length
                if index < ready:
                    total += (low[tap] * (1 - share) + high[tap] * share) * samples[index * points + point]
            out[point, frame] = gain * total
    counts[at.DRY] = 1 if dry else 0
    counts[at.GENERATED] = first + at.QUANTUM
    over = not looped and ready == length and (first + at.QUANTUM) * ratio >= length
    voice[at.LOUDNESS] = -1e9 if over else 0.0
