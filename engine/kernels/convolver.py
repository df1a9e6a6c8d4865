"""The sum of all voices through an impulse response, stereo, without delay: bodies and rooms.

Partitioned convolution in the frequency domain with partitions of two sizes: W. G. Gardner, "Efficient convolution
without input-output delay", J. Audio Eng. Soc. 43 (1995) 127; F. Wefers, "Partitioned convolution algorithms for
real-time auralization", Aachen 2015. The first `EARLY` partitions have the length of a quantum: each is done within
its own. Those after them have the length of a window, and what they give is due a window after their input is whole:
the work is spread over the window's quanta. The first transforms the input, the last two transform back, those
between each take their share of the frequencies.

The input's spectra do not depend on the response. So another response is computed beside the one that is heard for
a window and then faded to; what has been played rings on in it. After as much silence as the response is long,
nothing is left and nothing is computed.
"""

from __future__ import annotations

import math

import numpy as np
from numba import carray, njit

from engine.kernels import layout as at
from engine.kernels.compiled import COMPILED
from engine.kernels.fourier import ONE, fill_circle, row, silence, transform, turn
from engine.kernels.memory import fence, pointer

_SUMMING = at.WINDOW_QUANTA - 3  # quanta: one transforms the input, two transform back
_SHARE = -(-(at.WINDOW + 1) // _SUMMING)  # frequencies in each
FADE_S = 0.020  # at least: the way from one response to another, in whole windows


@njit(**COMPILED)
def convolve(mixer: np.ndarray) -> None:
    """Replaces the mix, (QUANTUM, 2), by its sound with the response. Without a response it is left as it is."""
    counts = mixer.view(np.int64)
    if counts[at.M_EFFECTS] == 0 and counts[at.M_EFFECTS_NOW] == 0 and counts[at.M_EFFECTS_NEXT] == 0:
        return
    fence()
    convolver = carray(pointer(counts[at.M_CONVOLVER]), (1 << 40,), np.float64)
    whole = convolver.view(np.int64)
    mix = mixer[at.M_MIX : at.M_MIX + 2 * at.QUANTUM].reshape(at.QUANTUM, 2)
    heard = _clean(counts, mix)
    if not whole[at.C_ACTIVE] or whole[at.C_PHASE] == 0:
        _exchange(counts, whole)
    step, now = whole[at.C_STEP], counts[at.M_EFFECTS_NOW]
    if step < 0 and now == 0:
        return
    if not whole[at.C_ACTIVE]:
        if step < 0 and not heard:
            return
        _wake(convolver, whole)
    whole[at.C_QUIET] = 0 if heard else whole[at.C_QUIET] + 1
    _listen(convolver, whole, mix, step == 0 and now == 0)
    lane, tail = whole[at.C_LANE], 0
    if now != 0:
        tail = _play(convolver, whole, now, lane, step < whole[at.C_FADE_WINDOWS])
    if step >= 0 and counts[at.M_EFFECTS_NEXT] != 0:
        _play(convolver, whole, counts[at.M_EFFECTS_NEXT], 1 - lane, True)
    _mix(convolver, whole, mix, now != 0, counts[at.M_EFFECTS_NEXT] != 0)
    whole[at.C_PHASE] = (whole[at.C_PHASE] + 1) % at.WINDOW_QUANTA
    if step < 0 and whole[at.C_QUIET] > tail:
        whole[at.C_ACTIVE] = 0


@njit(**COMPILED)
def _clean(counts: np.ndarray, mix: np.ndarray) -> bool:
    """Leaves only what may ring on. Returns whether there is anything."""
    heard = False
    for frame in range(at.QUANTUM):
        left, right = mix[frame, 0], mix[frame, 1]
        if not (abs(left) < at.LARGEST and abs(right) < at.LARGEST):
            left = right = 0.0
            counts[at.M_NON_FINITE] += 1
        if abs(left) < at.SMALLEST:
            left = 0.0
        if abs(right) < at.SMALLEST:
            right = 0.0
        heard = heard or left != 0.0 or right != 0.0
        mix[frame, 0], mix[frame, 1] = left, right
    return heard


@njit(**COMPILED)
def _exchange(counts: np.ndarray, whole: np.ndarray) -> None:
    """Continues with a change of the response, or begins one; it is made at once where it is inaudible."""
    if whole[at.C_STEP] >= 0:
        whole[at.C_STEP] += 1
        if whole[at.C_STEP] <= whole[at.C_FADE_WINDOWS]:
            return
        _take(counts, whole)
    wanted, now = counts[at.M_EFFECTS], counts[at.M_EFFECTS_NOW]
    if wanted == now:
        return
    counts[at.M_EFFECTS_NEXT] = wanted
    fence()
    if counts[at.M_EFFECTS] != wanted:  # it may be gone already: ask again
        counts[at.M_EFFECTS_NEXT] = 0
        return
    whole[at.C_STEP] = 0
    if now == 0:
        whole[at.C_ACTIVE] = 0  # the input up to now is not known
    if counts[at.M_FRAMES] == 0 or (now != 0 and not whole[at.C_ACTIVE]):
        _take(counts, whole)


@njit(**COMPILED)
def _take(counts: np.ndarray, whole: np.ndarray) -> None:
    """The next response is the one that is heard."""
    whole[at.C_STEP] = -1
    whole[at.C_LANE] = 1 - whole[at.C_LANE]
    counts[at.M_EFFECTS_NOW] = counts[at.M_EFFECTS_NEXT]
    fence()
    counts[at.M_EFFECTS_NEXT] = 0


@njit(**COMPILED)
def _wake(convolver: np.ndarray, whole: np.ndarray) -> None:
    """Reset the convolver, as if there had never been any input."""
    convolver[at.C_EARLY_INPUT : at.C_WORK] = 0.0
    convolver[at.C_GIVEN : at.C_WET] = 0.0
    whole[at.C_PHASE] = whole[at.C_WINDOWS] = whole[at.C_QUIET] = 0
    whole[at.C_EARLY_FILLED] = whole[at.C_LATE_FILLED] = 0
    whole[at.C_ACTIVE] = 1


@njit(**COMPILED)
def _listen(convolver: np.ndarray, whole: np.ndarray, mix: np.ndarray, softly: bool) -> None:
    """The spectra of the input's last two quanta and, where a window is over, of its last two windows.

    softly: the first window of a sound that began before; with an edge it would click, and ring on.
    """
    phase = whole[at.C_PHASE]
    if phase == 0:
        if whole[at.C_WINDOWS] > 0:
            place = (whole[at.C_LATE_PLACE] + 1) % whole[at.C_CAPACITY]
            spectrum = at.C_LATE + place * 4 * (at.WINDOW + 1)
            _analyse(convolver, at.C_LATE_INPUT, at.WINDOW, spectrum)
            whole[at.C_LATE_PLACE] = place
            whole[at.C_LATE_FILLED] = min(whole[at.C_LATE_FILLED] + 1, whole[at.C_CAPACITY])
        whole[at.C_WINDOWS] += 1
        whole[at.C_HALF] = 1 - whole[at.C_HALF]
    for side in range(2):
        early = convolver[at.C_EARLY_INPUT + side * 2 * at.QUANTUM :]
        late = convolver[at.C_LATE_INPUT + side * 2 * at.WINDOW + at.WINDOW + phase * at.QUANTUM :]
        for frame in range(at.QUANTUM):
            share = _way((phase * at.QUANTUM + frame + 1) / at.WINDOW) if softly else 1.0
            early[at.QUANTUM + frame] = late[frame] = share * mix[frame, side]
    place = (whole[at.C_EARLY_PLACE] + 1) % at.EARLY
    _analyse(convolver, at.C_EARLY_INPUT, at.QUANTUM, at.C_EARLY + place * 4 * (at.QUANTUM + 1))
    whole[at.C_EARLY_PLACE] = place
    whole[at.C_EARLY_FILLED] = min(whole[at.C_EARLY_FILLED] + 1, at.EARLY)


@njit(**COMPILED)
def _analyse(convolver: np.ndarray, source: int, half: int, spectrum: int) -> None:
    """The spectra of two real signals (2, 2 half) by one complex transform; their later halves become the earlier."""
    n = 2 * half
    re, im, re2, im2 = _work(convolver, n)
    for frame in range(n):
        re[frame], im[frame] = convolver[source + frame], convolver[source + n + frame]
    for side in range(2):
        signal = convolver[source + side * n : source + (side + 1) * n]
        for frame in range(half):
            signal[frame] = signal[half + frame]
    _transform(convolver, re, im, re2, im2)
    bins = half + 1
    left_re, left_im = convolver[spectrum : spectrum + bins], convolver[spectrum + bins : spectrum + 2 * bins]
    spectrum += 2 * bins
    right_re, right_im = convolver[spectrum : spectrum + bins], convolver[spectrum + bins : spectrum + 2 * bins]
    for k in range(bins):
        mirror = n - k if k > 0 else 0
        left_re[k], left_im[k] = 0.5 * (re[k] + re[mirror]), 0.5 * (im[k] - im[mirror])
        right_re[k], right_im[k] = 0.5 * (im[k] + im[mirror]), 0.5 * (re[mirror] - re[k])


@njit(**COMPILED)
def _play(convolver: np.ndarray, whole: np.ndarray, address: int, lane: int, later: bool) -> int:
    """A quantum of a lane; `later`: the next window needs it too. Returns after how many quanta it has rung out."""
    impulse = carray(pointer(address), (1 << 40,), np.float64)
    sizes = impulse.view(np.int64)
    channels, early, late = sizes[at.I_CHANNELS], sizes[at.I_EARLY], sizes[at.I_LATE]
    bins, sums = at.QUANTUM + 1, at.C_SUMS + 8 * (at.WINDOW + 1)
    count = min(early, whole[at.C_EARLY_FILLED])
    place = whole[at.C_EARLY_PLACE]
    _multiply(convolver, at.C_EARLY, at.EARLY, place, impulse[at.I_HEADER :], channels, count, bins, 0, bins, sums)
    wet = at.C_WET + lane * 2 * at.QUANTUM
    _synthesise(convolver, sums, at.QUANTUM, wet)
    if late > 0:
        given = at.C_GIVEN + (2 * lane + whole[at.C_HALF]) * 2 * at.WINDOW + whole[at.C_PHASE] * at.QUANTUM
        for side in range(2):
            for frame in range(at.QUANTUM):
                convolver[wet + side * at.QUANTUM + frame] += convolver[given + side * at.WINDOW + frame]
        if later:
            first = at.I_HEADER + early * channels * 2 * (at.QUANTUM + 1)
            _compute(convolver, whole, impulse[first:], channels, late, lane)
    return early + (late + 4) * at.WINDOW_QUANTA


@njit(**COMPILED)
def _compute(
    convolver: np.ndarray, whole: np.ndarray, impulse: np.ndarray, channels: int, late: int, lane: int
) -> None:
    """Compute this quantum's part of what the late partitions give in the next window."""
    phase, bins, sums = whole[at.C_PHASE], at.WINDOW + 1, at.C_SUMS + lane * 4 * (at.WINDOW + 1)
    count = min(late, whole[at.C_LATE_FILLED])
    if 1 <= phase <= _SUMMING:
        begin, end = (phase - 1) * _SHARE, min(phase * _SHARE, bins)
        place = whole[at.C_LATE_PLACE]
        capacity = whole[at.C_CAPACITY]
        _multiply(convolver, at.C_LATE, capacity, place, impulse, channels, count, bins, begin, end, sums)
    elif phase == at.WINDOW_QUANTA - 2 + lane:
        goal = at.C_GIVEN + (2 * lane + 1 - whole[at.C_HALF]) * 2 * at.WINDOW
        if count > 0:
            _synthesise(convolver, sums, at.WINDOW, goal)
        else:
            convolver[goal : goal + 2 * at.WINDOW] = 0.0


@njit(**COMPILED)
def _multiply(
    convolver: np.ndarray,
    spectra: int,
    ring: int,
    place: int,
    impulse: np.ndarray,
    channels: int,
    count: int,
    bins: int,
    begin: int,
    end: int,
    sums: int,
) -> None:
    """The sum over partitions of input times response, at some of the frequencies."""
    for side in range(2):
        of = side if channels == 2 else 0
        sum_re = convolver[sums + side * 2 * bins + begin : sums + side * 2 * bins + end]
        sum_im = convolver[sums + (side * 2 + 1) * bins + begin : sums + (side * 2 + 1) * bins + end]
        sum_re[:] = 0.0
        sum_im[:] = 0.0
        for partition in range(count):
            slot = (place - partition + ring) % ring
            x = spectra + (slot * 2 + side) * 2 * bins
            h = (partition * channels + of) * 2 * bins
            x_re, x_im = convolver[x + begin : x + end], convolver[x + bins + begin : x + bins + end]
            h_re, h_im = impulse[h + begin : h + end], impulse[h + bins + begin : h + bins + end]
            for k in range(end - begin):
                sum_re[k] += x_re[k] * h_re[k] - x_im[k] * h_im[k]
                sum_im[k] += x_re[k] * h_im[k] + x_im[k] * h_re[k]


@njit(**COMPILED)
def _synthesise(convolver: np.ndarray, spectrum: int, half: int, goal: int) -> None:
    """The later halves (2, half) of two real signals from their spectra, by one complex transform."""
    n, bins = 2 * half, half + 1
    re, im, re2, im2 = _work(convolver, n)
    left_re, left_im = convolver[spectrum : spectrum + bins], convolver[spectrum + bins : spectrum + 2 * bins]
    spectrum += 2 * bins
    right_re, right_im = convolver[spectrum : spectrum + bins], convolver[spectrum + bins : spectrum + 2 * bins]
    for k in range(bins):
        re[k], im[k] = left_re[k] - right_im[k], left_im[k] + right_re[k]
    for k in range(1, half):
        re[n - k], im[n - k] = left_re[k] + right_im[k], right_re[k] - left_im[k]
    _transform(convolver, im, re, im2, re2)  # exchanged: the inverse
    for frame in range(half):
        convolver[goal + frame], convolver[goal + half + frame] = re[half + frame], im[half + frame]


@njit(**COMPILED)
def _work(convolver: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    work = convolver[at.C_WORK : at.C_WORK + 4 * n]
    return work[:n], work[n : 2 * n], work[2 * n : 3 * n], work[3 * n : 4 * n]


@njit(**COMPILED)
def _transform(convolver: np.ndarray, re: np.ndarray, im: np.ndarray, re2: np.ndarray, im2: np.ndarray) -> None:
    cosines, sines = convolver[at.C_COSINES : at.C_SINES], convolver[at.C_SINES : at.C_EARLY_INPUT]
    transform(re, im, re2, im2, cosines, sines)


@njit(**COMPILED)
def _mix(convolver: np.ndarray, whole: np.ndarray, mix: np.ndarray, wet_now: bool, wet_next: bool) -> None:
    """The output: a lane, or the fade from one to the other.

    A lane without a response is the mix itself.
    """
    step, lane = whole[at.C_STEP], whole[at.C_LANE]
    now, following = at.C_WET + lane * 2 * at.QUANTUM, at.C_WET + (1 - lane) * 2 * at.QUANTUM
    done = (step - 1) * at.WINDOW + whole[at.C_PHASE] * at.QUANTUM
    frames = whole[at.C_FADE_WINDOWS] * at.WINDOW
    for side in range(2):
        for frame in range(at.QUANTUM):
            dry = mix[frame, side]
            value = convolver[now + side * at.QUANTUM + frame] if wet_now else dry
            if step > 0:
                other = convolver[following + side * at.QUANTUM + frame] if wet_next else dry
                value += _way((done + frame + 1) / frames) * (other - value)
            mix[frame, side] = value


@njit(**COMPILED)
def _way(share: float) -> float:
    """The smooth way from 0 to 1, without a corner."""
    return share * share * (3 - 2 * share)


@njit(**COMPILED)
def begin(convolver: np.ndarray, rate_hz: float, frames: int) -> None:
    """Set up a convolver's memory, which is all 0, for responses of so many frames."""
    whole = convolver.view(np.int64)
    whole[at.C_CAPACITY] = late_partitions(frames) + 1
    whole[at.C_FADE_WINDOWS] = math.ceil(FADE_S * rate_hz / at.WINDOW)
    whole[at.C_STEP] = -1
    fill_circle(convolver[at.C_COSINES : at.C_SINES], convolver[at.C_SINES : at.C_EARLY_INPUT])


@njit(**COMPILED)
def convolver_slots(frames: int) -> int:
    """The memory of a convolver for responses of so many frames."""
    return at.C_LATE + (late_partitions(frames) + 1) * 4 * (at.WINDOW + 1)


@njit(**COMPILED)
def late_partitions(frames: int) -> int:
    """The partitions of a window's length of a response."""
    return max(0, (frames - at.EARLY * at.QUANTUM + at.WINDOW - 1) // at.WINDOW)


@njit(**COMPILED)
def early_partitions(frames: int) -> int:
    """The partitions of a quantum's length before them."""
    return min(at.EARLY, (frames + at.QUANTUM - 1) // at.QUANTUM)


@njit(**COMPILED)
def partitioned_slots(frames: int, channels: int) -> int:
    """The memory of a response in partitions."""
    early, late = early_partitions(frames), late_partitions(frames)
    return at.I_HEADER + 2 * channels * (early * (at.QUANTUM + 1) + late * (at.WINDOW + 1))


@njit(**COMPILED)
def partition(work: np.ndarray, response: np.ndarray, frames: int, memory: np.ndarray) -> None:
    """Writes a response (frames, 1 or 2) as the convolver reads it; the inverse transform's factor is in it.

    Args:
        work: a work space of `fourier` for two windows.
        frames: of it with silence at the end.
    """
    channels, early, late = response.shape[1], early_partitions(frames), late_partitions(frames)
    counts = memory.view(np.int64)
    counts[at.I_CHANNELS], counts[at.I_EARLY], counts[at.I_LATE] = channels, early, late
    place, first = at.I_HEADER, 0
    for number in range(early + late):
        length = at.QUANTUM if number < early else at.WINDOW
        for channel in range(channels):
            re, im = row(work, ONE, 2 * length), row(work, ONE + 1, 2 * length)
            silence(work, ONE, 0, 2 * length)
            for frame in range(min(length, len(response) - first)):
                re[frame] = response[first + frame, channel]
            turn(work, ONE, ONE + 1, 2 * length)
            for k in range(length + 1):
                memory[place + k] = re[k] / (2 * length)
                memory[place + length + 1 + k] = im[k] / (2 * length)
            place += 2 * (length + 1)
        first += length
