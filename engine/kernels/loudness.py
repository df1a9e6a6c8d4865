"""The loudness and peak of a key, from its modes as they set out: a few microseconds, without Python.

Measured as loudness meters do: mean square after the K-weighting of ITU-R BS.1770-5, here over the first part of the
note. The quiet instrument's modes decay each by itself. So the mean square is a sum over them, each through the
body's power at its frequency. The peak is looked for in the sum of the modes over one period of the lowest; each
passes through the body as in its steady state; a body that is struck by the release itself may peak higher.

A sound is its modes, in rows of `constants`: ω, σ, and amplitudes left and right, re full scale, with room for
the peak. `swings`: modes set out from rest at speeds, as sines, otherwise from their amplitudes, as cosines.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from engine.kernels import constants as of
from engine.kernels.compiled import kernel

# BS.1770: the shelf and the high-pass as analogue filters of second order
_SHELF_HZ = 1681.97
_SHELF_DB = 4.0
_SHELF_Q = 0.7072
_PASS_HZ, _PASS_Q = 38.135, 0.5003
_FRAMES = (8, 256)  # of the period in which the peak is looked for
_FRAMES_A_PERIOD = 2.5  # of the highest mode
_TINY = 1e-30
LOOKED_AT = 5  # keys of an instrument, whose peaks are known


@kernel
def looked_at(low: int, high: int, number: int) -> int:
    """The key of a number among those whose peaks are known: evenly over the range."""
    return low + (2 * number * (high - low) + LOOKED_AT - 1) // (2 * (LOOKED_AT - 1))


@kernel
def k_weight(hz: Any) -> Any:
    """The square of the gain of K-weighting at a frequency, or at each of an array."""
    gain = 10 ** (_SHELF_DB / 20)
    middle = 10 ** (_SHELF_DB / 40)
    squared = hz * hz
    shelf, high_pass = _SHELF_HZ**2, _PASS_HZ**2
    above = (shelf - gain * squared) ** 2 + (middle / _SHELF_Q) ** 2 * shelf * squared
    below = (shelf - squared) ** 2 + shelf * squared / _SHELF_Q**2
    return above / below * squared**2 / ((high_pass - squared) ** 2 + high_pass * squared / _PASS_Q**2)


@kernel
def _at(body: np.ndarray, which: int, place: float) -> float:
    """A row of a body's curves at a place of its grid."""
    left = int(place)
    first = of.BODY_HEADER + which * of.BODY_POINTS + left
    return body[first] + (place - left) * (body[first + 1] - body[first])


@kernel
def _place(omega: float) -> float:
    """The place of a frequency on the grid of a body's curves."""
    place = of.BODY_STEPS * math.log2(max(omega / (2 * math.pi * of.BODY_LOWEST_HZ), 1.0))
    return min(place, of.BODY_POINTS - 1.001)


@kernel
def _noise(body: np.ndarray, mix: float) -> float:
    """The power of noise of power 1 through direct sound and body, mixed; the sound is divided by its root."""
    return (1 - mix) ** 2 + 2 * mix * (1 - mix) * body[of.BODY_CROSS] + mix * mix


@kernel
def _power(body: np.ndarray, mix: float, place: float) -> float:
    """The square of the gain of direct sound and body, mixed, at a place of the grid; to be divided by `_noise`."""
    alike = 2 * mix * (1 - mix) * _at(body, of.BODY_REAL, place)
    return max((1 - mix) ** 2 + alike + mix * mix * _at(body, of.BODY_POWER, place), 0.0)


@kernel
def gain(sound: np.ndarray, modes: int, points: int, body: np.ndarray, mix: float) -> float:
    """The factor that brings a sound at the reference velocity to the wanted level; 1 where it is silent.

    Args:
        points: 1 or 2 amplitudes of each mode that count.
        body, mix: its curves, as `constants` has them, and how much of it is heard; at 0 they are not read.
    """
    total = 0.0
    noise = _noise(body, mix) if mix > 0.0 else 1.0
    for mode in range(modes):
        omega, falls = sound[of.SOUND_OMEGA * modes + mode], 2 * of.PART_S * sound[of.SOUND_SIGMA * modes + mode]
        left, right = sound[of.SOUND_LEFT * modes + mode], sound[of.SOUND_RIGHT * modes + mode]
        mean = -math.expm1(-falls) / falls if falls > 1e-6 else 1.0
        power = _power(body, mix, _place(omega)) / noise if mix > 0.0 else 1.0
        total += (left * left + right * right) * mean * power * k_weight(omega / (2 * math.pi))
    total *= 0.5 / points
    if not total > 0.0:  # at a fixed end: it would be far too loud anywhere else
        return 1.0
    return 10 ** (min(max(of.WANTED_DB - 10 * math.log10(total), of.GAIN_RANGE_DB[0]), of.GAIN_RANGE_DB[1]) / 20)


@kernel
def peak(sound: np.ndarray, modes: int, swings: bool, body: np.ndarray, mix: float, least: float) -> float:
    """An estimate of the highest sample of a sound, re full scale.

    Args:
        swings, body, mix: as the module and `gain` have them.
        least: where the sum of all amplitudes is not above it, that sum stands in for the search in time.
    """
    x, y = of.SOUND_X * modes, of.SOUND_Y * modes
    noise, onset = 1.0, 0.0
    if mix > 0.0:
        noise = math.sqrt(_noise(body, mix))
        onset = (1 - mix + mix * body[of.BODY_STEP]) / noise
    bound = sum_left = sum_right = highest = 0.0
    for mode in range(modes):
        real, imaginary = 1.0, 0.0
        if mix > 0.0:
            place = _place(sound[of.SOUND_OMEGA * modes + mode])
            real = 1 - mix + mix * _at(body, of.BODY_REAL, place)
            imaginary = mix * _at(body, of.BODY_IMAGINARY, place)
            size = math.sqrt(_power(body, mix, place)) / noise
            magnitude = math.sqrt(real * real + imaginary * imaginary)
            real, imaginary = (
                (real / magnitude * size, imaginary / magnitude * size) if magnitude > _TINY else (size, 0.0)
            )
        left, right = sound[of.SOUND_LEFT * modes + mode], sound[of.SOUND_RIGHT * modes + mode]
        bound += max(abs(left), abs(right)) * math.sqrt(real * real + imaginary * imaginary)
        sum_left += left
        sum_right += right
        highest = max(highest, sound[of.SOUND_OMEGA * modes + mode])
        sound[x + mode] = imaginary if swings else real
        sound[y + mode] = -real if swings else imaginary
    struck = 0.0 if swings else max(abs(sum_left), abs(sum_right)) * onset
    if bound <= least or modes == 0:
        return max(bound, struck)
    lowest = sound[of.SOUND_OMEGA * modes]
    frames = int(_FRAMES_A_PERIOD * highest / lowest + 0.75)  # never about to be one more for harmonic partials
    frames = min(max(frames, _FRAMES[0]), _FRAMES[1])
    step_s = 2 * math.pi / lowest / frames
    cosine, sine = of.SOUND_COSINE * modes, of.SOUND_SINE * modes
    for mode in range(modes):
        shrinks = math.exp(-sound[of.SOUND_SIGMA * modes + mode] * step_s)
        turn = sound[of.SOUND_OMEGA * modes + mode] * step_s
        sound[cosine + mode] = shrinks * math.cos(turn)
        sound[sine + mode] = shrinks * math.sin(turn)
    return max(struck, _highest(sound, modes, frames))


@kernel
def _highest(sound: np.ndarray, modes: int, frames: int) -> float:
    """The highest of both channels' samples in so many frames, of modes that turn from frame to frame.

    Rows SOUND_X and SOUND_Y hold the modes as they set out, and are overwritten.
    """
    left, right = sound[of.SOUND_LEFT * modes :][:modes], sound[of.SOUND_RIGHT * modes :][:modes]
    x, y = sound[of.SOUND_X * modes :][:modes], sound[of.SOUND_Y * modes :][:modes]
    cosine, sine = sound[of.SOUND_COSINE * modes :][:modes], sound[of.SOUND_SINE * modes :][:modes]
    highest = 0.0
    for _ in range(frames):
        sum_left, sum_right = 0.0, 0.0
        for mode in range(modes):
            before = x[mode]
            sum_left += left[mode] * before
            sum_right += right[mode] * before
            x[mode] = cosine[mode] * before - sine[mode] * y[mode]
            y[mode] = sine[mode] * before + cosine[mode] * y[mode]
        highest = max(highest, abs(sum_left), abs(sum_right))
    return highest


@kernel
def limit(highest: float) -> float:
    """The factor that lowers a peak to the highest one; 1 where it is not above."""
    most = 10 ** (of.HIGHEST_PEAK_DB / 20)
    return most / highest if highest > most else 1.0
