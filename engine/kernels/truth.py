"""A voice of the solved string: the splitting scheme of `engine.truth.splitting`, heard at two points.

Its modes are its own and may change while it rings; the flows between two kicks follow from them.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.kernels import layout as at
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import matrix
from engine.kernels.modes import damped, glide, gliding, rest_above, rest_silent, row, turn
from engine.kernels.rotation import rotation


@njit(**COMPILED)
def _sub_steps(voice: np.ndarray, program: np.ndarray) -> int:
    """The number of sub-steps of a frame, by the highest mode that moves; 0: what is linear needs none."""
    counts = voice.view(np.int64)
    n = counts[at.MODES]
    squares, couplings = row(voice, n, at.OMEGA_SQUARED), row(voice, n, at.COUPLING)
    steps = counts[at.JAVARI_STEPS]
    if couplings[n - 1] == 0.0:
        return steps
    highest = math.sqrt(squares[counts[at.MOVING] - 1])
    found = max(1, math.ceil(program[at.T_SUBSTEPS] * highest / (2 * math.pi * program[at.T_RATE])))
    return found if steps == 0 else (found + steps - 1) // steps * steps


@njit(**COMPILED)
def _prepare(voice: np.ndarray, program: np.ndarray, sub_steps: int) -> None:
    """The exact damped rotations between kicks, of half the palindrome."""
    counts = voice.view(np.int64)
    n = counts[at.MODES]
    squares, sigmas = row(voice, n, at.OMEGA_SQUARED), row(voice, n, at.SIGMA)
    for stage in range(at.STAGES // 2 if sub_steps else 1):
        time_s = (program[at.T_ROTATIONS + stage] / sub_steps if sub_steps else 1.0) / program[at.T_RATE]
        first = at.FOLLOWING + 4 * stage
        qq, qv = row(voice, n, first), row(voice, n, first + 1)
        vq, vv = row(voice, n, first + 2), row(voice, n, first + 3)
        for m in range(n):
            qq[m], qv[m], vq[m], vv[m] = rotation(sigmas[m], damped(squares[m], sigmas[m]), time_s)
    counts[at.STEPS], counts[at.PREPARED], voice[at.JAVARI_GIVE] = sub_steps, 1, 0.0


@njit(**COMPILED)
def set_up(voice: np.ndarray, program: np.ndarray) -> int:
    """Brings what follows from its modes up to date for a quantum; its sub-steps, 0 where it is linear."""
    counts = voice.view(np.int64)
    changed = gliding(voice)
    if changed:
        glide(voice)
        rest_above(voice, program[at.T_RATE])
    sub_steps = _sub_steps(voice, program)
    if changed or not counts[at.PREPARED] or sub_steps != counts[at.STEPS]:
        _prepare(voice, program, sub_steps)
    return sub_steps


@njit(**COMPILED)
def advance(
    voice: np.ndarray,
    program: np.ndarray,
    sub_steps: int,
    frame: int,
    fading: bool,
    heard: bool,
    out: np.ndarray,
) -> None:
    """Advance by one frame of a quantum, after it is heard."""
    hear(voice, program, frame, fading, heard, out)
    ring(voice, program, sub_steps, max(sub_steps, 1))


@njit(**COMPILED)
def hear(voice: np.ndarray, program: np.ndarray, frame: int, fading: bool, heard: bool, out: np.ndarray) -> None:
    """The output of a frame.

    The highest modes are left out from when they are below the program's silence: sub-steps follow those left. Where
    a contact may wake them they are not.
    """
    counts = voice.view(np.int64)
    n, points = counts[at.MODES], counts[at.POINTS]
    q, v, squares = row(voice, n, 0), row(voice, n, 1), row(voice, n, at.OMEGA_SQUARED)
    silence = program[at.T_SILENCE] if counts[at.JAVARI_STEPS] == 0 else 0.0
    moving = counts[at.MOVING]
    if heard:
        for which in range(2 if fading else 1):
            for point in range(points):
                slot = at.weights(n, which, point, 0)
                w = voice[slot : slot + n]
                found = 0.0
                for m in range(moving):
                    found += w[m] * q[m]
                out[2 * which + point, frame] = found
    if frame % 16 == 0:
        counts[at.MOVING], total = rest_silent(q, v, squares, moving, silence)
        voice[at.LOUDNESS] = (0.5 * math.log(total) if total > 0 else -1e9) + program[at.T_LOUDNESS]


@njit(**COMPILED)
def ring(voice: np.ndarray, program: np.ndarray, sub_steps: int, count: int) -> None:
    """Advance by so many of a frame's sub-steps; of what is linear, 0, it is the frame."""
    counts = voice.view(np.int64)
    n, moving = counts[at.MODES], counts[at.MOVING]
    q, v = row(voice, n, 0), row(voice, n, 1)
    couplings, stretches = row(voice, n, at.COUPLING), row(voice, n, at.STRETCH)
    step_s = 1 / (max(sub_steps, 1) * program[at.T_RATE])
    for _ in range(count):
        stretch = 0.0
        for stage in range(at.STAGES if sub_steps else 1):
            kick = program[at.T_KICKS + stage - 1] * step_s * stretch if stage > 0 else 0.0
            first = at.state(n) + (at.FOLLOWING + 4 * min(stage, at.STAGES - 1 - stage)) * n
            stretch = turn(q, v, moving, matrix(voice, first, 4, n), kick, couplings, stretches)


@njit(**COMPILED)
def generate(voice: np.ndarray, program: np.ndarray, fading: bool, heard: bool, out: np.ndarray) -> None:
    """The next quantum, (4, QUANTUM); frame 0 is the string at its release."""
    sub_steps = set_up(voice, program)
    for frame in range(at.QUANTUM):
        advance(voice, program, sub_steps, frame, fading, heard, out)
    voice.view(np.int64)[at.GENERATED] += at.QUANTUM
