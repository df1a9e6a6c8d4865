"""A voice that reads samples which a thread renders ahead, converted to the device's rate by a windowed sinc."""

from __future__ import annotations

import numpy as np
from numba import carray

from engine.kernels.compiled import kernel
from engine.kernels.constants import QUANTUM
from engine.kernels.memory import behind, fence, pointer
from engine.kernels.voice_records import RenderedProgram, Voice


@kernel
def generate(voice: Voice, program: RenderedProgram, out: np.ndarray) -> None:
    """Write the next quantum, (4, QUANTUM), one row for each point.

    Where the samples are not there yet it fades out, then stands still and counts the frames as `starved`.
    """
    taps = program.taps
    phases = program.phases
    ratio = program.ratio
    table = behind(program, program.filter, 2 * taps * (phases + 2))
    points, looped = voice.points, voice.looped
    ready, length = voice.ready, voice.length
    fence()
    samples = carray(pointer(voice.samples), (length * points,), np.float32)
    first = voice.generated
    # of this quantum and the next, so that there is a quantum in which to fade out
    needed = int((first + 2 * QUANTUM) * ratio) + taps + 1
    dry, was_dry = ready < length and ready < needed, voice.dry
    if dry and (was_dry or first == 0):
        voice.dry = 1
        out[:] = 0.0
        voice.starved += QUANTUM
        return
    for frame in range(QUANTUM):
        place = float((first + frame) % length) if looped else (first + frame) * ratio
        before = int(place)
        phase = (place - before) * phases
        row = int(phase)
        share = phase - row
        gain = 1.0
        if dry:
            gain = 1.0 - (frame + 1) / QUANTUM
        elif was_dry:
            gain = (frame + 1) / QUANTUM
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
    voice.dry = 1 if dry else 0
    voice.generated = first + QUANTUM
    over = not looped and ready == length and (first + QUANTUM) * ratio >= length
    voice.loudness = -1e9 if over else 0.0
