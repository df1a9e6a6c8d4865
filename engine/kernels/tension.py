"""Latents that share one tension: `engine.models.koopman_tension`, compiled, for models and for a voice.

A voice is what that module says, at the device's own rate, in metres and seconds. Its modes are its own and may
change while it rings: what the latents turn by follows from them and from the program's three curves.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.kernels import layout as at
from engine.kernels.compiled import COMPILED
from engine.kernels.modes import damped, following, glide, gliding, rest_above, row

ENERGY_BOUND = 1.5  # of the energy at the start, as in the model
HARDEST_KICK, MOST_NODES = 0.3, 3  # as in the model
NEWTON_STEPS, NEWTON_DONE = 20, 1e-9  # at most; of the tension: a smaller change is the last
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
    for string in range(batch):
        xs, ys = x[string], y[string]
        moving = modes
        for step in range(steps):
            for _ in range(nodes):
                node(xs, ys, moving, largest_stretches[string], rows[0], rows[1], rows[2], rows[3], rows[4], rows[5])
            largest_energies[string] *= decay
            moving, _ = settle(xs, ys, moving, silence, largest_energies[string], rows[7])
            tension = 0.0
            for n in range(moving):
                tension += rows[4, n] * xs[n] * xs[n]
            frame = out[string, step]
            for n in range(moving):
                frame[n] = xs[n] * (1 - rows[6, n] * tension)
            for n in range(moving, modes):
                frame[n] = 0.0


@njit(**COMPILED)
def prepare(voice: np.ndarray, program: np.ndarray, q: np.ndarray, v: np.ndarray) -> None:
    """The rows that follow from the voice's modes, its amplitudes and speeds (modes,): as `KoopmanTension.step`."""
    counts, whole = voice.view(np.int64), program.view(np.int64)
    n, rate = counts[at.MODES], program[at.S_RATE]
    squares, sigmas = row(voice, n, at.OMEGA_SQUARED), row(voice, n, at.SIGMA)
    couplings, stretches = row(voice, n, at.COUPLING), row(voice, n, at.STRETCH)
    rows = following(voice, n)
    last = rest_above(voice, rate)
    highest = program[at.S_HIGHEST_PHASE]
    fastest = max(
        damped(squares[0], sigmas[0]) / program[at.S_NODE_PHASE], damped(squares[last], sigmas[last]) / highest
    )
    kick = 0.0
    for m in range(last + 1):
        omega = damped(squares[m], sigmas[m])
        kick += stretches[m] * couplings[m] * (q[m] * q[m] + (v[m] / omega) ** 2)
    fastest = min(max(fastest, math.sqrt(kick) / HARDEST_KICK), MOST_NODES * fastest)
    nodes = max(1, math.ceil(fastest / rate))
    h, coefficients = 1 / (nodes * rate), whole[at.S_COEFFICIENTS]
    slowest = np.inf
    for m in range(n):
        sigma, omega = sigmas[m], damped(squares[m], sigmas[m])
        slowest = min(slowest, sigma)
        phase = h * omega
        argument = min(max(2 * (phase / highest) ** 2 - 1, -1.0), 1.0)
        growth = r = p = 0.0
        now, before = 1.0, argument  # Chebyshev polynomials
        for degree in range(coefficients):
            growth += program[at.S_HEADER + degree] * now
            r += program[at.S_HEADER + coefficients + degree] * now
            p += program[at.S_HEADER + 2 * coefficients + degree] * now
            now, before = (2 * argument * now - before, now)
        growth = min(max(1 + phase * phase * growth, 0.0), 2.0)
        r, p = min(max(r, -1.0), 1.0), min(max(p, -1.0), 1.0)
        kappa, angle, shrunk = h * h * couplings[m], h * couplings[m] / omega, math.exp(-h * sigma)
        rows[0, m], rows[1, m] = shrunk * math.cos(phase), shrunk * math.sin(phase)
        rows[2, m], rows[3, m] = angle * growth, angle * kappa * r
        rows[4, m], rows[5, m] = stretches[m] * growth, stretches[m] * kappa * r
        rows[6, m], rows[7, m] = kappa * p, omega * omega
    counts[at.STEPS] = nodes
    voice[at.DECAY] = math.exp(-2 * slowest / rate)


@njit(**COMPILED)
def _half_kick(rows: np.ndarray, x: np.ndarray, largest_stretch: float, y: np.ndarray, sign: float) -> None:
    """Half of what `node` does first, forward or back, in place of y."""
    first = second = 0.0
    for m in range(len(x)):
        square = x[m] * x[m]
        first += rows[4, m] * square
        second += rows[5, m] * square
    first = min(first, largest_stretch)
    linear, squared = first * (1 - 2 * second), first * first
    for m in range(len(x)):
        y[m] += sign * 0.5 * (rows[2, m] * linear - rows[3, m] * squared) * x[m]


@njit(**COMPILED)
def physical(voice: np.ndarray, q: np.ndarray, v: np.ndarray) -> None:
    """Amplitudes in m and speeds in m/s, (modes,), of a voice as it is now: the inverse of `set_out`, to rounding."""
    counts = voice.view(np.int64)
    n = counts[at.MODES]
    x, y = row(voice, n, 0), row(voice, n, 1)
    rows = following(voice, n)
    sigmas, stretches = row(voice, n, at.SIGMA), row(voice, n, at.STRETCH)
    for m in range(n):
        v[m] = y[m]
    _half_kick(rows, x, voice[at.LARGEST_STRETCH], v, 1.0)
    tension = 0.0  # S₀ of x = q (1 + κ p S₀), by Newton's method
    for _ in range(NEWTON_STEPS):
        value, slope = -tension, 1.0
        for m in range(n):
            lift = 1 + rows[6, m] * tension
            square = stretches[m] * (x[m] / lift) ** 2
            value += square
            slope += 2 * square * rows[6, m] / lift
        change = value / slope
        tension += change
        if not abs(change) > NEWTON_DONE * abs(tension):
            break
    moved = 0.0
    for m in range(n):
        q[m] = x[m] / (1 + rows[6, m] * tension)
        v[m] = -math.sqrt(rows[7, m]) * v[m] - sigmas[m] * q[m]
        moved += stretches[m] * q[m] * v[m]
    for m in range(n):
        v[m] = v[m] * (1 + rows[6, m] * tension) + 2 * rows[6, m] * q[m] * moved


@njit(**COMPILED)
def set_out(voice: np.ndarray, q: np.ndarray, v: np.ndarray, bounded: bool) -> None:
    """The coordinates in which kicks act, half a kick before the first node, of amplitudes and speeds (modes,).

    As `KoopmanTension._set_out`.

    Args:
        bounded: the largest energy is there, and may only fall; otherwise it follows from the input.
    """
    counts = voice.view(np.int64)
    n = counts[at.MODES]
    x, y = row(voice, n, 0), row(voice, n, 1)
    rows = following(voice, n)
    sigmas, couplings, stretches = row(voice, n, at.SIGMA), row(voice, n, at.COUPLING), row(voice, n, at.STRETCH)
    tension = held = energy = widest = 0.0
    for m in range(n):
        omega, square = math.sqrt(rows[7, m]), q[m] * q[m]
        tension += stretches[m] * square
        held += couplings[m] * square
        y[m] = -(v[m] + sigmas[m] * q[m]) / omega
        energy += rows[7, m] * (square + y[m] * y[m])
        widest = max(widest, stretches[m] / rows[7, m])
    largest = ENERGY_BOUND * (energy + 0.5 * tension * held)
    voice[at.LARGEST_ENERGY] = min(voice[at.LARGEST_ENERGY], largest) if bounded else largest
    voice[at.LARGEST_STRETCH] = voice[at.LARGEST_ENERGY] * widest
    moved, share = 0.0, 1.0
    for m in range(n):
        part = stretches[m] * q[m] / (1 + rows[6, m] * tension)
        moved += part * v[m]
        share += 2 * part * rows[6, m] * q[m]
    moved /= share
    for m in range(n):
        lift = 1 + rows[6, m] * tension
        lifted = (v[m] - 2 * rows[6, m] * q[m] * moved) / lift
        x[m] = q[m] * lift
        y[m] -= (lifted - v[m]) / math.sqrt(rows[7, m])
    _half_kick(rows, x, voice[at.LARGEST_STRETCH], y, -1.0)


@njit(**COMPILED)
def _bring_up_to_date(voice: np.ndarray, program: np.ndarray) -> None:
    """What follows from its modes, and the latents, where a voice begins or its modes change."""
    counts = voice.view(np.int64)
    n = counts[at.MODES]
    if counts[at.PREPARED] and not gliding(voice):
        return
    q, v, squares = row(voice, n, at.PHYSICAL), row(voice, n, at.PHYSICAL + 1), following(voice, n)[7]
    if counts[at.PREPARED]:
        physical(voice, q, v)
        glide(voice)
        raised = 1.0  # by the work that raises the tension
        for m in range(n):
            omega = damped(row(voice, n, at.OMEGA_SQUARED)[m], row(voice, n, at.SIGMA)[m])
            raised = max(raised, omega * omega / squares[m])
        voice[at.LARGEST_ENERGY] *= raised
    else:
        q[:], v[:] = row(voice, n, 0), row(voice, n, 1)
        if gliding(voice):
            glide(voice)
    prepare(voice, program, q, v)
    for m in range(counts[at.MOVING], n):
        q[m] = v[m] = 0.0
    set_out(voice, q, v, bool(counts[at.PREPARED]))
    counts[at.PREPARED] = 1


@njit(**COMPILED)
def generate(voice: np.ndarray, program: np.ndarray, fading: bool, heard: bool, out: np.ndarray) -> None:
    """The next quantum, (4, QUANTUM); frame 0 is the string at its release."""
    _bring_up_to_date(voice, program)
    counts = voice.view(np.int64)
    n = counts[at.MODES]
    x, y = row(voice, n, 0), row(voice, n, 1)
    rows = following(voice, n)
    moving, nodes, points = counts[at.MOVING], counts[at.STEPS], counts[at.POINTS]
    sets = 2 if fading else 1
    total = 0.0
    for frame in range(at.QUANTUM):
        if heard:
            tension = 0.0
            for m in range(moving):
                tension += rows[4, m] * x[m] * x[m]
            for which in range(sets):
                for point in range(points):
                    place = at.weights(n, which, point, 0)
                    weights = voice[place : place + n]
                    found = 0.0
                    for m in range(moving):
                        found += weights[m] * (x[m] - rows[6, m] * tension * x[m])
                    out[2 * which + point, frame] = found
        for _ in range(nodes):
            node(x, y, moving, voice[at.LARGEST_STRETCH], rows[0], rows[1], rows[2], rows[3], rows[4], rows[5])
        voice[at.LARGEST_ENERGY] *= voice[at.DECAY]
        if frame % 16 == 15:
            moving, total = settle(x, y, moving, program[at.S_SILENCE], voice[at.LARGEST_ENERGY], rows[7])
    counts[at.MOVING] = moving
    counts[at.GENERATED] += at.QUANTUM
    voice[at.LOUDNESS] = (0.5 * math.log(total) if total > 0 else -1e9) + program[at.S_LOUDNESS]
