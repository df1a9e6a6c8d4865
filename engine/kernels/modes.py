"""A voice's modes, which may change while it rings: another tension, length or damping.

What they shall be is a block of memory that somebody else wrote; its address is the command. The kernel goes there in
equal steps, one a quantum, of ω², σ, k, η² (`engine.resonators.base`) and of what a bridge takes (`kernels.courses`).
Amplitude and speed of each mode stay as they are: it is their equation that changes.
"""

from __future__ import annotations

import math

import numpy as np

from engine.kernels import voice_records as at
from engine.kernels.compiled import inlined, kernel
from engine.kernels.fields import slots
from engine.kernels.memory import behind, fence, shaped, wish_at
from engine.kernels.rotation import rotation

TOO_HIGH = 3.0  # rad a frame: a mode that is raised beyond is laid to rest, for it would sound as another
BEHIND_VOICE, BEHIND_WISH = slots(at.VOICE), slots(at.WISH)


@kernel
def weights(voice: at.Voice, which: int, point: int, part: int) -> np.ndarray:
    """The weights (modes,) of a set, at a point, of the real (0) or imaginary (1) parts."""
    return behind(voice, BEHIND_VOICE + ((which * 2 + point) * 2 + part) * voice.modes, voice.modes)


@kernel
def rows(voice: at.Voice, first: int, count: int) -> np.ndarray:
    """Rows of a voice, (count * modes,), one after the other."""
    return behind(voice, BEHIND_VOICE + (at.WEIGHT_ROWS + first) * voice.modes, count * voice.modes)


@kernel
def row(voice: at.Voice, which: int) -> np.ndarray:
    """The row (modes,) of that number of a voice."""
    return rows(voice, which, 1)


@inlined
def motion(voice: at.Voice) -> tuple[np.ndarray, np.ndarray]:
    """The two rows that move: amplitude and speed, or x and y."""
    return row(voice, 0), row(voice, 1)


@kernel
def table(voice: at.Voice, first: int, count: int) -> np.ndarray:
    """Rows of a voice, from the number `first` on, as an array (count, modes)."""
    return shaped(rows(voice, first, count), 0, (count, voice.modes))


@kernel
def following(voice: at.Voice) -> np.ndarray:
    """The values that follow from modes of latents with one tension, (7, modes): see `kernels.tension.prepare`."""
    return table(voice, at.FOLLOWING, 7)


@kernel
def wished_rows(address: int, modes: int) -> np.ndarray:
    """The rows of the modes that are wished for, (RESONATOR_ROWS * modes,), one after the other."""
    return behind(wish_at(address), BEHIND_WISH, at.RESONATOR_ROWS * modes)


@kernel
def gliding(voice: at.Voice) -> bool:
    """Return True if the voice's modes are still to change."""
    return voice.resonator != voice.current_modes or voice.glide > 0


@kernel
def glide(voice: at.Voice) -> None:
    """Move a voice's modes a quantum's step towards those of the latest wish that is due."""
    wanted = voice.resonator
    if wanted != voice.current_modes:
        fence()
        voice.glide = max(1, wish_at(wanted).quanta)
        voice.current_modes = wanted
    present, left = rows(voice, at.OMEGA_SQUARED, at.RESONATOR_ROWS), voice.glide
    target_rows = wished_rows(voice.current_modes, voice.modes)
    for place in range(len(present)):
        present[place] += (target_rows[place] - present[place]) / left
    voice.glide = left - 1


@kernel
def damped(omega_squared: float, sigma: float) -> float:
    """√(ω² - σ²) in rad/s, but ω/10 at least: a mode that would no longer swing swings slowly."""
    return math.sqrt(max(omega_squared - sigma * sigma, 0.01 * omega_squared))


@kernel
def eased(share: float) -> float:
    """0 … 1 as 0 … 1, without the corners at which a loud string that fades in milliseconds would click."""
    return share * share * (3 - 2 * share)


@kernel
def run_up(voice: at.Voice, seconds: float) -> None:
    """Advance a voice that has not begun by so long; each mode moves alone, at rest's tension."""
    q, v = motion(voice)
    squares = row(voice, at.OMEGA_SQUARED)
    sigmas, lost = row(voice, at.SIGMA), row(voice, at.BRIDGE)
    for m in range(voice.modes):
        sigma = sigmas[m] + lost[m]
        qq, qv, vq, vv = rotation(sigma, damped(squares[m], sigma), seconds)
        q[m], v[m] = qq * q[m] + qv * v[m], vq * q[m] + vv * v[m]


@kernel
def rest_silent(q: np.ndarray, v: np.ndarray, squares: np.ndarray, moving: int, silence: float) -> tuple[int, float]:
    """Set the highest modes to 0, amplitude and speed, whose amplitude is below a share `silence` of that of all.

    Of the first `moving` modes; `squares` are their ω². Return how many are left, and Σ q² + v²/ω² of all.
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


@inlined
def turn(
    q: np.ndarray,
    v: np.ndarray,
    moving: int,
    flow: np.ndarray,
    kick: float,
    coupling: np.ndarray,
    stretches: np.ndarray,
) -> float:
    """Apply a kick of the tension, then the exact turn of each mode; return the stretch Σ η² q² after it.

    Args:
        moving: the number of modes that move, the first ones.
        flow: (4, modes), see `rotation`.
        kick: the time of the kick, times the stretch before it.
        coupling, stretches: k and η², (modes,).
    """
    qq = flow[0]
    qv = flow[1]
    vq = flow[2]
    vv = flow[3]
    stretch = 0.0
    for m in range(moving):
        amplitude = q[m]
        speed = v[m] - kick * coupling[m] * amplitude
        turned = qq[m] * amplitude + qv[m] * speed
        q[m] = turned
        v[m] = vq[m] * amplitude + vv[m] * speed
        stretch += stretches[m] * turned * turned
    return stretch


@kernel
def rest_above(voice: at.Voice, rate: float) -> int:
    """Set modes to 0 that lie too high for the rate in Hz; return the number of the highest that does not."""
    squares = row(voice, at.OMEGA_SQUARED)
    sigmas = row(voice, at.SIGMA)
    first, second = motion(voice)
    last = voice.modes - 1
    while last > 0 and damped(squares[last], sigmas[last]) > TOO_HIGH * rate:
        last -= 1
    for m in range(last + 1, voice.moving):
        first[m] = second[m] = 0.0
    voice.moving = min(voice.moving, last + 1)
    return last
