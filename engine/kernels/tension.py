"""Latents that share one tension: `engine.models.koopman_tension`, compiled, for models and for a voice.

A voice is what that module says, at the device's own rate: its program is the model of that rate, in metres.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.kernels import layout as at
from engine.kernels.compiled import COMPILED

NOTHING = 1e-60  # squares of displacement: what is left is put to zero, before it becomes denormal


@njit(**COMPILED)
def node(
    x: np.ndarray,
    y: np.ndarray,
    moving: int,
    largest_stretch: float,
    cosine: np.ndarray,
    sine: np.ndarray,
    kick: np.ndarray,
    second_kick: np.ndarray,
    stretch: np.ndarray,
    second_stretch: np.ndarray,
) -> None:
    """The kick of the common tension and the turn to the next node, in place, of the lowest modes that move.

    Rows (modes,): λ's parts, h k A/ω, h k κ r/ω, η² A and η² κ r.
    """
    first = second = 0.0
    for n in range(moving):
        square = x[n] * x[n]
        first += stretch[n] * square
        second += second_stretch[n] * square
    first = min(first, largest_stretch)
    linear, squared = first * (1 - 2 * second), first * first
    for n in range(moving):
        kicked = y[n] + (kick[n] * linear - second_kick[n] * squared) * x[n]
        turned = cosine[n] * x[n] - sine[n] * kicked
        y[n] = sine[n] * x[n] + cosine[n] * kicked
        x[n] = turned


@njit(**COMPILED)
def settle(
    x: np.ndarray, y: np.ndarray, moving: int, silence: float, largest_energy: float, squared_frequencies: np.ndarray
) -> tuple[int, float]:
    """Holds Σ ω² |z|² below the largest, lays the highest modes to rest that are silent; those left, and Σ |z|²."""
    total = energy = 0.0
    for n in range(moving):
        size = x[n] * x[n] + y[n] * y[n]
        total += size
        energy += squared_frequencies[n] * size
    if not energy <= largest_energy:  # also where it is not a number
        factor = math.sqrt(largest_energy / energy) if energy < np.inf else 0.0
        for n in range(moving):
            x[n] *= factor
            y[n] *= factor
            if not (abs(x[n]) < np.inf and abs(y[n]) < np.inf):
                x[n] = y[n] = 0.0
        total *= factor * factor
        if not total < np.inf:
            total = 0.0
    while moving > 1:
        n = moving - 1
        if not x[n] * x[n] + y[n] * y[n] < silence * silence * total + NOTHING:
            break
        x[n] = y[n] = 0.0
        moving = n
    if total < NOTHING:
        x[0] = y[0] = 0.0
    return moving, total


@njit(**COMPILED)
def advance(
    x: np.ndarray,
    y: np.ndarray,
    largest_energies: np.ndarray,
    largest_stretches: np.ndarray,
    decay: float,
    nodes: int,
    silence: float,
    rows: np.ndarray,
    out: np.ndarray,
) -> None:
    """Advances x and y (batch, modes) in place; writes the amplitudes out (batch, steps, modes).

    Args:
        largest_energies: of Σ ω² |z|², (batch,), which fall by `decay` a frame, in place.
        largest_stretches: of S, (batch,).
        nodes: of a frame.
        silence: the highest modes rest from when their amplitude is below this share of that of all together.
        rows: (8, modes): the six that `node` takes, κ p, and ω².
    """
    batch, steps, modes = out.shape
    for row in range(batch):
        xs, ys = x[row], y[row]
        moving = modes
        for step in range(steps):
            for _ in range(nodes):
                node(xs, ys, moving, largest_stretches[row], rows[0], rows[1], rows[2], rows[3], rows[4], rows[5])
            largest_energies[row] *= decay
            moving, _ = settle(xs, ys, moving, silence, largest_energies[row], rows[7])
            tension = 0.0
            for n in range(moving):
                tension += rows[4, n] * xs[n] * xs[n]
            frame = out[row, step]
            for n in range(moving):
                frame[n] = xs[n] * (1 - rows[6, n] * tension)
            for n in range(moving, modes):
                frame[n] = 0.0


@njit(**COMPILED)
def generate(voice: np.ndarray, program: np.ndarray, fading: bool, heard: bool, out: np.ndarray) -> None:
    """The next quantum, (4, QUANTUM); frame 0 is the string as it is let go."""
    whole = program.view(np.int64)
    counts = voice.view(np.int64)
    n = whole[at.S_MODES]
    place = at.state(n)
    x, y = voice[place : place + n], voice[place + n : place + 2 * n]
    largest = voice[place + 2 * n :]
    rows = program[at.S_HEADER : at.S_HEADER + 8 * n].reshape(8, n)
    moving = counts[at.MOVING]
    points = counts[at.POINTS]
    sets = 2 if fading else 1
    total = 0.0
    for frame in range(at.QUANTUM):
        if heard:
            tension = 0.0
            for m in range(moving):
                tension += rows[4, m] * x[m] * x[m]
            for which in range(sets):
                for point in range(points):
                    slot = at.weights(n, which, point, 0)
                    plain, bent = voice[slot : slot + n], voice[slot + n : slot + 2 * n]
                    found = seen = 0.0
                    for m in range(moving):
                        found += plain[m] * x[m]
                        seen += bent[m] * x[m]
                    out[2 * which + point, frame] = found - tension * seen
        for _ in range(whole[at.S_NODES]):
            node(x, y, moving, largest[1], rows[0], rows[1], rows[2], rows[3], rows[4], rows[5])
        largest[0] *= program[at.S_DECAY]
        if frame % 16 == 15:
            moving, total = settle(x, y, moving, program[at.S_SILENCE], largest[0], rows[7])
    counts[at.MOVING] = moving
    counts[at.GENERATED] += at.QUANTUM
    voice[at.LOUDNESS] = (0.5 * math.log(total) if total > 0 else -1e9) + program[at.S_LOUDNESS]
