"""Impulse responses of bodies and rooms: at another rate, filtered, faded, as loud as what they are given, in series.

A response is (frames, 2). Both channels go through a transform as one complex signal, left its real part, since all
filters here are real. `work` is a work space of `fourier` that holds the transform (`work_size`).
"""

from __future__ import annotations

import math

import numpy as np

from engine.kernels import constants as of
from engine.kernels.compiled import kernel
from engine.kernels.fourier import ONE, SPARE, TWO, power_of_two, row, silence, turn, turn_any
from engine.kernels.memory import shaped

FADE_SHARE = 0.1  # of a response that is cut: its end
FINEST_RATIO = 1000  # denominators of ratios of rates: within a cent
CURVES_FINEST_HZ = 0.75  # of the spectrum that a body's curves are taken from
_LEAST = 1e-30
_DRY, _BODY, _ROOM, _BOTH = range(4)  # parts of a mix; the three cases that something is heard of are numbered alike


@kernel
def load(work: np.ndarray, signal: int, sound: np.ndarray, size: int) -> None:
    """Write a response into a signal of the work space, with silence behind it."""
    re, im = row(work, signal, size), row(work, signal + 1, size)
    frames = len(sound)
    for frame in range(frames):
        re[frame], im[frame] = sound[frame, 0], sound[frame, 1]
    silence(work, signal, frames, size)


@kernel
def analyse(work: np.ndarray, signal: int, sound: np.ndarray, size: int) -> None:
    """Write the spectrum of a response, left and right as one complex signal, into rows `signal` and `signal + 1`."""
    load(work, signal, sound, size)
    turn(work, signal, signal + 1, size)


@kernel
def store(work: np.ndarray, signal: int, sound: np.ndarray, size: int) -> None:
    """Transform a spectrum back into a response."""
    turn(work, signal + 1, signal, size)
    re, im = row(work, signal, size), row(work, signal + 1, size)
    for frame in range(len(sound)):
        sound[frame, 0], sound[frame, 1] = re[frame] / size, im[frame] / size


@kernel
def _channels(work: np.ndarray, signal: int, k: int, size: int) -> tuple[complex, complex]:
    """The spectra of left and right at a frequency, from that of both as one signal."""
    re = row(work, signal, size)
    im = row(work, signal + 1, size)
    mirror = (size - k) % size
    left = complex(0.5 * (re[k] + re[mirror]), 0.5 * (im[k] - im[mirror]))
    right = complex(0.5 * (im[k] + im[mirror]), 0.5 * (re[mirror] - re[k]))
    return left, right


@kernel
def high_pass(work: np.ndarray, sound: np.ndarray, edge_hz: float, rate_hz: float) -> None:
    """Filter a response through Butterworth's high-pass of second order."""
    size = power_of_two(2 * len(sound))
    analyse(work, ONE, sound, size)
    re, im = row(work, ONE, size), row(work, ONE + 1, size)
    re[0] = im[0] = 0.0
    for k in range(1, size // 2 + 1):
        s = k * rate_hz / size / edge_hz
        below, slope = 1 - s * s, math.sqrt(2) * s
        power = below * below + slope * slope
        real, imaginary = -s * s * below / power, s * s * slope / power
        if 2 * k == size:
            re[k], im[k] = real * re[k], real * im[k]  # where both halves meet the response is real
            break
        mirror = size - k
        re[k], im[k] = real * re[k] - imaginary * im[k], real * im[k] + imaginary * re[k]
        re[mirror], im[mirror] = (
            real * re[mirror] + imaginary * im[mirror],
            real * im[mirror] - imaginary * re[mirror],
        )
    store(work, ONE, sound, size)


@kernel
def fade(sound: np.ndarray) -> None:
    """Fade the end of a response to nothing."""
    frames = max(1, int(np.rint(FADE_SHARE * len(sound))))
    for frame in range(frames):
        share = 0.5 + 0.5 * math.cos(math.pi * (frame + 1) / frames)
        sound[len(sound) - frames + frame, 0] *= share
        sound[len(sound) - frames + frame, 1] *= share


@kernel
def fraction(ratio: float) -> tuple[int, int]:
    """The nearest fraction with a denominator up to FINEST_RATIO, of a ratio in 2⁻¹⁰ … 2¹⁰.

    By continued fractions, as Python's `Fraction.limit_denominator`.
    """
    denominator = 1 << 54
    over, under = int(ratio * denominator), denominator
    before, before_under = 0, 1
    last, last_under = 1, 0
    while under > 0:
        whole = over // under
        next_under = before_under + whole * last_under
        if next_under > FINEST_RATIO:
            break
        before, last = last, before + whole * last
        before_under, last_under = last_under, next_under
        over, under = under, over - whole * under
    if under == 0:
        return last, last_under
    more = (FINEST_RATIO - before_under) // last_under
    if 2.0 * under * (before_under + more * last_under) <= float(denominator):
        return last, last_under
    return before + more * last, before_under + more * last_under


@kernel
def resampled_frames(frames: int, from_hz: float, to_hz: float) -> int:
    """The length of a response at another rate."""
    return frames if from_hz == to_hz else max(1, int(np.rint(frames * to_hz / from_hz)))


@kernel
def _periods(frames: int, from_hz: float, to_hz: float) -> tuple[int, int]:
    """The frames at either rate of one duration that is whole at both, at least twice that of the response."""
    numerator, denominator = fraction(to_hz / from_hz)
    units = (frames + denominator - 1) // denominator
    return 2 * units * denominator, 2 * units * numerator


@kernel
def work_size(frames: int, from_hz: float, to_hz: float) -> int:
    """The width of a work space for a response, and for bringing it to another rate."""
    resampled = resampled_frames(frames, from_hz, to_hz)
    size = power_of_two(max(2 * frames, 2 * resampled, 4))
    return size if from_hz == to_hz else max(size, _resampling_size(frames, resampled, from_hz, to_hz))


@kernel
def _resampling_size(frames: int, resampled: int, from_hz: float, to_hz: float) -> int:
    """The size of transforms between a response and its frequencies at either rate."""
    padded, made = _periods(frames, from_hz, to_hz)
    return power_of_two(max(frames, resampled) + min(padded, made))


@kernel
def resample(work: np.ndarray, sound: np.ndarray, from_hz: float, to_hz: float, resampled: np.ndarray) -> None:
    """Write a response at another rate, as far as there is room, by its Fourier series with as much silence.

    It takes any ratio, in bounded time.
    """
    if from_hz == to_hz:
        for frame in range(len(resampled)):
            resampled[frame, 0], resampled[frame, 1] = sound[frame, 0], sound[frame, 1]
        return
    padded, made = _periods(len(sound), from_hz, to_hz)
    kept = min(padded, made) // 2  # frequencies from 0 on, without that at half the lower rate: its phase is lost
    size = _resampling_size(len(sound), len(resampled), from_hz, to_hz)
    load(work, ONE, sound, size)
    turn_any(work, padded, len(sound), kept, len(sound) + kept - 2, size)
    re, im = row(work, ONE, size), row(work, ONE + 1, size)
    silence(work, ONE, kept, size - kept + 1)
    for k in range(size):
        im[k] = -im[k]  # back: the conjugate of the transform of the conjugate
    turn_any(work, made, kept, len(resampled), kept - 1, size)
    for frame in range(len(resampled)):
        resampled[frame, 0], resampled[frame, 1] = re[frame] / padded, -im[frame] / padded


@kernel
def _measured(frames: int, rate_hz: float) -> tuple[int, int, int]:
    """The size of the transform that loudness is measured by, the first frequency of it that counts, and the last."""
    size = power_of_two(max(frames, int(rate_hz) // 4))
    first, last = math.ceil(of.LOUDNESS_LOW_HZ * size / rate_hz), math.floor(of.LOUDNESS_HIGH_HZ * size / rate_hz)
    return size, int(first), min(int(last), size // 2)


@kernel
def level(work: np.ndarray, sound: np.ndarray, rate_hz: float) -> None:
    """Scale a response so that noise of equal power in each octave keeps its level, in the mean of both channels."""
    size, first, last = _measured(len(sound), rate_hz)
    analyse(work, ONE, sound, size)
    power = total = 0.0
    for k in range(first, last + 1):
        left, right = _channels(work, ONE, k, size)
        power += (left.real**2 + left.imag**2 + right.real**2 + right.imag**2) / k
        total += 2 / k
    factor = 1 / max(math.sqrt(power / total), _LEAST)
    for frame in range(len(sound)):
        sound[frame, 0] *= factor
        sound[frame, 1] *= factor


@kernel
def powers(work: np.ndarray, body: np.ndarray, room: np.ndarray, rate_hz: float, shares: np.ndarray) -> None:
    """The power of noise through each part of a mix, and what each two have in common, (4, 4).

    The parts are: nothing, the body, the room, both in series. A body or room without frames is not there.
    """
    size, first, last = _measured(max(len(body), len(room), len(body) + len(room) - 1), rate_hz)
    analyse(work, ONE, body, size)
    analyse(work, TWO, room, size)
    total = 0.0
    shares[:] = 0.0
    for k in range(first, last + 1):
        one, two = _channels(work, ONE, k, size), _channels(work, TWO, k, size)
        total += 2 / k
        for side in range(2):
            dry = complex(1.0, 0.0)
            parts = (dry, one[side], two[side], one[side] * two[side])
            for i in range(4):
                for j in range(4):
                    shares[i, j] += (parts[i].real * parts[j].real + parts[i].imag * parts[j].imag) / k
    for i in range(4):
        for j in range(4):
            shares[i, j] /= total


@kernel
def series(work: np.ndarray, body: np.ndarray, room: np.ndarray, both: np.ndarray) -> None:
    """Write the response of a body in a room, (frames + frames − 1, 2)."""
    size = power_of_two(len(both))
    analyse(work, ONE, body, size)
    analyse(work, TWO, room, size)
    re, im = row(work, ONE, size), row(work, ONE + 1, size)
    for k in range(size // 2 + 1):
        one = _channels(work, ONE, k, size)
        two = _channels(work, TWO, k, size)
        mirror = (size - k) % size
        left, right = one[0] * two[0], one[1] * two[1]
        re[k], im[k] = left.real - right.imag, left.imag + right.real
        re[mirror], im[mirror] = left.real + right.imag, right.real - left.imag
    store(work, ONE, both, size)


@kernel
def all_powers(work: np.ndarray, body: np.ndarray, room: np.ndarray, rate_hz: float, shares: np.ndarray) -> None:
    """Write `powers` of the cases that the body is heard, the room, and both, at their places of (4, 4, 4)."""
    powers(work, body, room[:0], rate_hz, shares[_BODY])
    powers(work, body[:0], room, rate_hz, shares[_ROOM])
    powers(work, body, room, rate_hz, shares[_BOTH])


@kernel
def weigh(cases: np.ndarray, body_mix: float, room_mix: float, weights: np.ndarray) -> None:
    """Write the weights (4,) of the parts of a mix, with which pink noise keeps its level, of `all_powers`."""
    weights[_DRY] = (1 - body_mix) * (1 - room_mix)
    weights[_BODY] = body_mix * (1 - room_mix)
    weights[_ROOM] = (1 - body_mix) * room_mix
    weights[_BOTH] = body_mix * room_mix
    # 1: the body is heard, 2: the room, 3: both, as parts are numbered
    case = (_BODY if body_mix > 0 else 0) + (_ROOM if room_mix > 0 else 0)
    power = 0.0
    for i in range(4):
        for j in range(4):
            power += weights[i] * weights[j] * cases[case, i, j]
    for part in range(4):
        weights[part] /= max(math.sqrt(power), _LEAST)


@kernel
def curves_size(frames: int) -> int:
    """The size of the spectrum that a body's curves are taken from."""
    return power_of_two(max(frames, int(np.rint(of.CURVES_HZ / CURVES_FINEST_HZ))))


@kernel
def curves(work: np.ndarray, body: np.ndarray, curve: np.ndarray) -> None:
    """Write the effect of a body on the loudness of keys (BODY_SLOTS,), see `constants`.

    Each value is the mean of the spectrum half-way to its neighbours.

    Args:
        body: its response at CURVES_HZ.
    """
    common = shaped(curve, 0, (4, 4))
    powers(work, body, body[:0], float(of.CURVES_HZ), common)
    curve[of.BODY_CROSS] = common[_DRY, _BODY]
    left = right = highest = 0.0
    for frame in range(len(body)):
        left += body[frame, 0]
        right += body[frame, 1]
        highest = max(highest, abs(left), abs(right))
    curve[of.BODY_STEP] = highest
    size = curves_size(len(body))
    analyse(work, ONE, body, size)
    count, step_hz = size // 2 + 1, of.CURVES_HZ / size
    for which in range(3):
        area, values = row(work, SPARE, count), row(work, SPARE + 1, count)  # area: from 0 Hz to a frequency
        for k in range(count):
            one, other = _channels(work, ONE, k, size)
            if which == of.BODY_REAL:
                values[k] = 0.5 * (one.real + other.real)
            elif which == of.BODY_IMAGINARY:
                values[k] = 0.5 * (one.imag + other.imag)
            else:
                values[k] = 0.5 * (one.real**2 + one.imag**2 + other.real**2 + other.imag**2)
        area[0] = 0.0
        for k in range(1, count):
            area[k] = area[k - 1] + 0.5 * (values[k - 1] + values[k]) * step_hz
        for point in range(of.BODY_POINTS):
            low_hz = of.BODY_LOWEST_HZ * 2 ** ((point - 0.5) / of.BODY_STEPS)
            high_hz = of.BODY_LOWEST_HZ * 2 ** ((point + 0.5) / of.BODY_STEPS)
            mean = (_between(area, high_hz / step_hz) - _between(area, low_hz / step_hz)) / (high_hz - low_hz)
            curve[of.BODY_HEADER + which * of.BODY_POINTS + point] = mean


@kernel
def _between(values: np.ndarray, place: float) -> float:
    """The value at a place, from 0, between two values: linear, and the last one beyond the end."""
    if place >= len(values) - 1:
        return values[len(values) - 1]
    before = int(place)
    return values[before] + (place - before) * (values[before + 1] - values[before])
