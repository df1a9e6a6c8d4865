"""A guitar amplifier on the sum of all voices: drive and tone. Its cabinet is a body.

One channel, the mean of both. A high-pass as between stages, then gain, a bias and the shape x/√(1 + x²), whose
integral √(1 + x²) is known: its mean over each step of the input replaces its values (first-order antiderivative
antialiasing: J. D. Parker, V. Zavalishin, E. Le Bivic, "Reducing the aliasing of nonlinear waveshaping using
continuous-time convolution", DAFx 2016). That mean is (x₀ + x₁)/(√(1 + x₀²) + √(1 + x₁²)), without a difference of
near numbers. All of this at twelve times the rate. The bias gives even partials, as a single valve does
(J. Pakarinen, D. T. Yeh, Computer Music Journal 33/2 (2009) 85). Bias, high-pass and tone are estimates.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.kernels import layout as at
from engine.kernels.compiled import COMPILED

NOMINAL = 0.15  # of full scale: a tone of this peak keeps its level, whatever the drive
BIAS = 0.25  # in the shape's own unit: 1 is where it bends most
COUPLING_HZ = 60.0  # high-pass before the drive
BLOCKING_HZ = 15.0  # high-pass behind it, for what the bias gives
PIVOT_HZ = 700.0  # of the tone, which raises one side and lowers the other
FADE_S = 0.020  # in which the amplifier is switched on or off
KAISER = 10.0  # of the window of the filter to and from the higher rate: images below -100 dB
PASSED = 0.4375  # of the rate: middle of the filter's edge, which ends at one half
REST_QUANTA = 400  # without input, after which all has died away


@njit(**COMPILED)
def drive(mixer: np.ndarray, drive_db: float, tone_db: float, level_db: float) -> None:
    """Set the amplifier of a mixer, see `engine.effects.Amp`; a tone of the peak NOMINAL keeps its level.

    The input is scaled to the level that it would have without `level_db`, so that it changes no drive.
    """
    amp = mixer[at.M_AMPLIFIER : at.MIXER_SLOTS]
    factor, level = 10 ** (drive_db / 20), 10 ** (level_db / 20)
    on = drive_db > 0
    amp[at.A_WANTED_GAIN] = level * math.sqrt(1 + (factor * NOMINAL) ** 2) / factor if on else 0.0
    amp[at.A_WANTED_TONE] = 10 ** (tone_db / 20) if on else 0.0
    amp[at.A_WANTED_DRIVE] = factor / level if on else 0.0


@njit(**COMPILED)
def amplify(mixer: np.ndarray) -> None:
    """Replaces the mix, (QUANTUM, 2), by its sound through the amplifier, where it is on."""
    amp = mixer[at.M_AMPLIFIER : at.MIXER_SLOTS]
    whole = amp.view(np.int64)
    wanted, share = amp[at.A_WANTED_DRIVE], amp[at.A_SHARE]
    if wanted == 0.0 and share == 0.0:
        whole[at.A_ON] = 0
        return
    first = mixer.view(np.int64)[at.M_FRAMES] == 0
    if whole[at.A_ON] == 0:
        _begin(amp, whole)
    if wanted > 0.0 and (first or share == 0.0):
        amp[at.A_DRIVE] = wanted
        amp[at.A_GAIN], amp[at.A_TONE] = amp[at.A_WANTED_GAIN], amp[at.A_WANTED_TONE]
    heard = _take(mixer, amp)
    whole[at.A_QUIET] = 0 if heard else whole[at.A_QUIET] + 1
    goal = 1.0 if wanted > 0.0 else 0.0
    step = 1.0 if first else at.QUANTUM / (FADE_S * mixer[at.M_RATE])
    reached = min(share + step, goal) if goal > share else max(share - step, goal)
    amp[at.A_SHARE] = reached
    if whole[at.A_QUIET] > REST_QUANTA:
        return
    _shape(amp)
    _give(mixer, amp, goal if first else share, reached)


@njit(**COMPILED)
def _begin(amp: np.ndarray, whole: np.ndarray) -> None:
    """Reset the amplifier, as if there had never been any input.

    All is at rest, which is where the bias has it.
    """
    amp[at.A_STATE :] = 0.0
    rest = BIAS / math.sqrt(1 + BIAS * BIAS)
    amp[at.A_STATE + 1], amp[at.A_STATE + 2] = BIAS, rest
    amp[at.A_SHAPED : at.A_OUT] = rest
    total = 0.0
    for tap in range(at.A_TAPS):
        place = tap - (at.A_TAPS - 1) / 2
        inside = 1 - (2 * place / at.A_TAPS) ** 2
        turns = 2 * math.pi * PASSED * place / at.OVERSAMPLING
        value = math.sin(turns) / turns * _bessel(KAISER * math.sqrt(inside))
        amp[at.A_FILTER + tap] = value
        total += value
    for tap in range(at.A_TAPS):
        amp[at.A_FILTER + tap] /= total
    whole[at.A_ON] = 1
    whole[at.A_QUIET] = 0


@njit(**COMPILED)
def _bessel(x: float) -> float:
    """I₀."""
    total = term = 1.0
    for k in range(1, 40):
        term *= (x / (2 * k)) ** 2
        total += term
    return total


@njit(**COMPILED)
def _take(mixer: np.ndarray, amp: np.ndarray) -> bool:
    """The next input behind the last one, through the high-pass. Returns whether there is any."""
    heard, low = False, amp[at.A_STATE]
    follows = 1 - math.exp(-2 * math.pi * COUPLING_HZ / mixer[at.M_RATE])
    last = at.A_TAPS // at.OVERSAMPLING
    for frame in range(last):
        amp[at.A_INPUT + frame] = amp[at.A_INPUT + at.QUANTUM + frame]
    for frame in range(at.QUANTUM):
        value = 0.5 * (mixer[at.M_MIX + 2 * frame] + mixer[at.M_MIX + 2 * frame + 1])
        if not abs(value) < at.LARGEST or abs(value) < at.SMALLEST:
            value = 0.0
        heard = heard or value != 0.0
        low += follows * (value - low)
        amp[at.A_INPUT + last + frame] = value - low
    amp[at.A_STATE] = low if abs(low) >= at.SMALLEST else 0.0
    return heard


@njit(**COMPILED)
def _shape(amp: np.ndarray) -> None:
    """Input to shaped output, at the higher rate: rows (OVERSAMPLING,) of frames, behind the last ones."""
    last, rows = at.A_TAPS // at.OVERSAMPLING, at.OVERSAMPLING
    wide = last + at.QUANTUM
    drive, goal = amp[at.A_DRIVE], amp[at.A_WANTED_DRIVE]
    if goal == 0.0:  # it is switched off: as it was
        goal = drive
    for row in range(rows):
        out = amp[at.A_SHAPED + row * wide : at.A_SHAPED + (row + 1) * wide]
        for frame in range(last):
            out[frame] = out[at.QUANTUM + frame]
        new = out[last:]
        new[:] = 0.0
        for lag in range(last):
            tap = rows * amp[at.A_FILTER + rows * lag + row]
            delayed = amp[at.A_INPUT + last - lag : at.A_INPUT + last - lag + at.QUANTUM]
            for frame in range(at.QUANTUM):
                new[frame] += tap * delayed[frame]
        for frame in range(at.QUANTUM):
            new[frame] = BIAS + new[frame] * (drive + (goal - drive) * (frame + (row + 1) / rows) / at.QUANTUM)
    before = amp[at.A_STATE + 1]
    root = math.sqrt(1 + before * before)
    for frame in range(last, wide):
        for row in range(rows):
            value = amp[at.A_SHAPED + row * wide + frame]
            following = math.sqrt(1 + value * value)
            amp[at.A_SHAPED + row * wide + frame] = (before + value) / (root + following)
            before, root = value, following
    amp[at.A_STATE + 1] = before


@njit(**COMPILED)
def _give(mixer: np.ndarray, amp: np.ndarray, share: float, share_to: float) -> None:
    """Bring the sound back to the rate of the mixer, without the mean, through gain and tone."""
    last, rows = at.A_TAPS // at.OVERSAMPLING, at.OVERSAMPLING
    wide = last + at.QUANTUM
    out = amp[at.A_OUT : at.A_OUT + at.QUANTUM]
    out[:] = 0.0
    for row in range(rows):
        for lag in range(last):
            tap = amp[at.A_FILTER + rows * lag + rows - 1 - row]
            first = at.A_SHAPED + row * wide + last - lag
            shaped = amp[first : first + at.QUANTUM]
            for frame in range(at.QUANTUM):
                out[frame] += tap * shaped[frame]
    drive, gain, tone = amp[at.A_DRIVE], amp[at.A_GAIN], amp[at.A_TONE]
    drive_to, gain_to, tone_to = amp[at.A_WANTED_DRIVE], amp[at.A_WANTED_GAIN], amp[at.A_WANTED_TONE]
    if drive_to == 0.0:
        drive_to, gain_to, tone_to = drive, gain, tone
    blocks = 1 - math.exp(-2 * math.pi * BLOCKING_HZ / mixer[at.M_RATE])
    follows = 1 - math.exp(-2 * math.pi * PIVOT_HZ / mixer[at.M_RATE])
    mean, low = amp[at.A_STATE + 2], amp[at.A_STATE + 3]
    for frame in range(at.QUANTUM):
        way = (frame + 1) / at.QUANTUM
        mean += blocks * (out[frame] - mean)
        value = (out[frame] - mean) * (gain + way * (gain_to - gain))
        low += follows * (value - low)
        high = tone + way * (tone_to - tone)
        value = low / high + (value - low) * high
        wet = share + way * (share_to - share)
        for side in range(2):
            dry = mixer[at.M_MIX + 2 * frame + side]
            mixer[at.M_MIX + 2 * frame + side] = value if wet == 1.0 else dry + wet * (value - dry)
    amp[at.A_STATE + 2], amp[at.A_STATE + 3] = mean, low if abs(low) >= at.SMALLEST else 0.0
    amp[at.A_DRIVE], amp[at.A_GAIN], amp[at.A_TONE] = drive_to, gain_to, tone_to
