"""A voice's modes, which may change while it rings: another tension, length or damping.

What they shall be is a block of memory that somebody else wrote; its address is the command. The kernel goes there in
equal steps, one a quantum, of ω², σ, k, η² (`engine.resonators.base`) and of what a bridge takes (`kernels.courses`).
Amplitude and speed of each mode stay as they are: it is their equation that changes.
"""

from __future__ import annotations

import math

import numpy as np
from numba import carray, njit

from engine.kernels import layout as at
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import fence, matrix, part, pointer
from engine.kernels.rotation import rotation

TOO_HIGH = 3.0  # rad a frame: a mode that is raised beyond is laid to rest, for it would sound as another


@njit(**COMPILED)
def row(voice: np.ndarray, modes: int, which: int) -> np.ndarray:
    """The row (modes,) of that number in a voice's state."""
    return part(voice, at.state(modes) + which * modes, modes)


@njit(**COMPILED)
def following(voice: np.ndarray, modes: int) -> np.ndarray:
    """The values that follow from modes of latents with one tension, (7, modes): see `kernels.tension.prepare`."""
    return matrix(voice, at.state(modes) + at.FOLLOWING * modes, 7, modes)


@njit(**COMPILED)
def gliding(voice: np.ndarray) -> bool:
    """Return True if the voice's modes are still to change."""
    counts = voice.view(np.int64)
    return counts[at.RESONATOR] != counts[at.CURRENT_MODES] or counts[at.GLIDE] > 0


@njit(**COMPILED)
def glide(voice: np.ndarray) -> None:
    """A step towards the modes that it is to have."""
    counts = voice.view(np.int64)
    wanted = counts[at.RESONATOR]
    if wanted != counts[at.CURRENT_MODES]:
        fence()
        counts[at.GLIDE] = max(1, carray(pointer(wanted), (at.B_HEADER,), np.int64)[at.B_QUANTA])
        counts[at.CURRENT_MODES] = wanted
    n, left = counts[at.MODES], counts[at.GLIDE]
    block = carray(pointer(counts[at.CURRENT_MODES]), (at.B_HEADER + at.RESONATOR_ROWS * n,), np.float64)
    present = at.state(n) + at.OMEGA_SQUARED * n
    for place in range(at.RESONATOR_ROWS * n):
        voice[present + place] += (block[at.B_HEADER + place] - voice[present + place]) / left
    counts[at.GLIDE] = left - 1


@njit(**COMPILED)
def damped(omega_squared: float, sigma: float) -> float:
    """√(ω² - σ²); a mode that would no longer swing swings slowly."""
    return math.sqrt(max(omega_squared - sigma * sigma, 0.01 * omega_squared))


@njit(**COMPILED)
def run_up(voice: np.ndarray, seconds: float) -> None:
    """Advance amplitudes and speeds of a voice that has not begun by so long.

    Each mode moves alone, at rest's tension.
    """
    n = voice.view(np.int64)[at.MODES]
    q, v, squares = row(voice, n, 0), row(voice, n, 1), row(voice, n, at.OMEGA_SQUARED)
    for m in range(n):
        sigma = row(voice, n, at.SIGMA)[m] + row(voice, n, at.BRIDGE)[m]
        qq, qv, vq, vv = rotation(sigma, damped(squares[m], sigma), seconds)
        q[m], v[m] = qq * q[m] + qv * v[m], vq * q[m] + vv * v[m]


@njit(**COMPILED)
def rest_silent(q: np.ndarray, v: np.ndarray, squares: np.ndarray, moving: int, silence: float) -> tuple[int, float]:
    """Lay the highest modes to rest whose amplitude is below a share of that of all.

    Returns how many are left, and Σ q² + v²/ω² of all, squares being ω².
    """
    total = 0.0
    for m in range(moving):
        total += q[m] * q[m] + v[m] * v[m] / squares[m]
    while moving > 1:
        m = moving - 1
        if not q[m] * q[m] + v[m] * v[m] / squares[m] < silence * silence * total:  # so that NaN is kept
            break
        q[m] = v[m] = 0.0
        moving = m
    return moving, total


@njit(inline="always", **COMPILED)
def turn(
    q: np.ndarray,
    v: np.ndarray,
    moving: int,
    flow: np.ndarray,
    kick: float,
    coupling: np.ndarray,
    stretches: np.ndarray,
) -> float:
    """A kick of the tension, then the exact turn of each mode by `flow`, (4, modes), see `rotation`; the stretch."""
    qq, qv, vq, vv = flow[0], flow[1], flow[2], flow[3]
    stretch = 0.0
    for m in range(moving):
        amplitude = q[m]
        speed = v[m] - kick * coupling[m] * amplitude
        turned = qq[m] * amplitude + qv[m] * speed
        q[m] = turned
        v[m] = vq[m] * amplitude + vv[m] * speed
        stretch += stretches[m] * turned * turned
    return stretch


@njit(**COMPILED)
def rest_above(voice: np.ndarray, rate: float) -> int:
    """Lays modes to rest that lie too high for the rate; the highest of the others."""
    counts = voice.view(np.int64)
    n = counts[at.MODES]
    squares, sigmas, first, second = (
        row(voice, n, at.OMEGA_SQUARED),
        row(voice, n, at.SIGMA),
        row(voice, n, 0),
        row(voice, n, 1),
    )
    last = n - 1
    while last > 0 and damped(squares[last], sigmas[last]) > TOO_HIGH * rate:
        last -= 1
    for m in range(last + 1, counts[at.MOVING]):
        first[m] = second[m] = 0.0
    counts[at.MOVING] = min(counts[at.MOVING], last + 1)
    return last
