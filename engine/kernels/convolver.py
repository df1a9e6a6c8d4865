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

There are two *lanes*, 0 and 1: what the input is through the response that is heard, `convolver.lane`, and through
the next one. A *window* is WINDOW_QUANTA quanta, and `convolver.phase` the number of a quantum within it. Spectra are
(partitions, channels, 2, bins), real parts first.
"""

from __future__ import annotations

import math

import numpy as np

from engine.kernels.compiled import kernel
from engine.kernels.constants import QUANTUM
from engine.kernels.fields import slots
from engine.kernels.fourier import ONE, fill_circle, row, silence, transform, turn
from engine.kernels.memory import address_of, convolver_at, fence, impulse_at, reals, shaped
from engine.kernels.mixer_records import (
    CONVOLVER,
    EARLY,
    IMPULSE,
    LARGEST,
    SMALLEST,
    WINDOW,
    WINDOW_QUANTA,
    Convolver,
    Impulse,
    Mixer,
)
from engine.kernels.modes import eased

_SUMMING = WINDOW_QUANTA - 3  # quanta: one transforms the input, two transform back
_SHARE = -(-(WINDOW + 1) // _SUMMING)  # frequencies in each
FADE_S = 0.020  # at least: the way from one response to another, in whole windows
BEHIND_CONVOLVER, BEHIND_IMPULSE = slots(CONVOLVER), slots(IMPULSE)


@kernel
def convolve(mixer: Mixer) -> None:
    """Replace the mix, (QUANTUM, 2), by its sound with the response. Without a response it is left as it is."""
    if mixer.effects == 0 and mixer.effects_now == 0 and mixer.effects_next == 0:
        return
    fence()
    convolver, mix = convolver_at(mixer.convolver), mixer.mix[:]
    sounds = _clean(mixer, mix)
    if not convolver.active or convolver.phase == 0:
        _exchange(mixer, convolver)
    step, now = convolver.step, mixer.effects_now
    if step < 0 and now == 0:
        return
    if not convolver.active:
        if step < 0 and not sounds:
            return
        _wake(convolver)
    convolver.quiet = 0 if sounds else convolver.quiet + 1
    _listen(convolver, mix, step == 0 and now == 0)
    lane, tail = convolver.lane, 0
    if now != 0:
        tail = _play(convolver, impulse_at(now), lane, step < convolver.fade_windows)
    if step >= 0 and mixer.effects_next != 0:
        _play(convolver, impulse_at(mixer.effects_next), 1 - lane, True)
    _mix(convolver, mix, now != 0, mixer.effects_next != 0)
    convolver.phase = (convolver.phase + 1) % WINDOW_QUANTA
    if step < 0 and convolver.quiet > tail:
        convolver.active = 0


@kernel
def _clean(mixer: Mixer, mix: np.ndarray) -> bool:
    """Replace samples of the mix that are no numbers, too large or too small by 0; return True if any is left."""
    sounds = False
    for frame in range(QUANTUM):
        left, right = mix[frame, 0], mix[frame, 1]
        if not (abs(left) < LARGEST and abs(right) < LARGEST):
            left = right = 0.0
            mixer.non_finite += 1
        if abs(left) < SMALLEST:
            left = 0.0
        if abs(right) < SMALLEST:
            right = 0.0
        sounds = sounds or left != 0.0 or right != 0.0
        mix[frame, 0], mix[frame, 1] = left, right
    return sounds


@kernel
def _exchange(mixer: Mixer, convolver: Convolver) -> None:
    """Continue with a change of the response, or begin one; it is made at once where it is inaudible."""
    if convolver.step >= 0:
        convolver.step += 1
        if convolver.step <= convolver.fade_windows:
            return
        _take(mixer, convolver)
    wanted, now = mixer.effects, mixer.effects_now
    if wanted == now:
        return
    mixer.effects_next = wanted
    fence()
    if mixer.effects != wanted:  # it may be gone already: ask again
        mixer.effects_next = 0
        return
    convolver.step = 0
    if now == 0:
        convolver.active = 0  # the input up to now is not known
    if mixer.frames == 0 or (now != 0 and not convolver.active):
        _take(mixer, convolver)


@kernel
def _take(mixer: Mixer, convolver: Convolver) -> None:
    """Make the next response the one that is heard; its lane becomes `convolver.lane`."""
    convolver.step = -1
    convolver.lane = 1 - convolver.lane
    mixer.effects_now = mixer.effects_next
    fence()
    mixer.effects_next = 0


@kernel
def _wake(convolver: Convolver) -> None:
    """Reset the convolver, as if there had never been any input."""
    convolver.early_input[:] = 0.0
    convolver.late_input[:] = 0.0
    convolver.given[:] = 0.0
    convolver.phase = convolver.windows = convolver.quiet = 0
    convolver.early_filled = convolver.late_filled = 0
    convolver.active = 1


@kernel
def _late(convolver: Convolver) -> np.ndarray:
    """The late spectra, (capacity, 2, 2, WINDOW + 1)."""
    return shaped(reals(address_of(convolver)), BEHIND_CONVOLVER, (convolver.capacity, 2, 2, WINDOW + 1))


@kernel
def _listen(convolver: Convolver, mix: np.ndarray, softly: bool) -> None:
    """Keep a quantum of input, and compute the spectra of its last two quanta and, as a window ends, two windows.

    `softly`: the input fades in over a window, as it began before; with an edge it would click, and ring on.
    """
    phase = convolver.phase
    early_input, late_input = convolver.early_input[:], convolver.late_input[:]
    if phase == 0:
        if convolver.windows > 0:
            place = (convolver.late_place + 1) % convolver.capacity
            _analyse(convolver, late_input, _late(convolver)[place])
            convolver.late_place = place
            convolver.late_filled = min(convolver.late_filled + 1, convolver.capacity)
        convolver.windows += 1
        convolver.half = 1 - convolver.half
    for side in range(2):
        early, late = early_input[side], late_input[side, WINDOW + phase * QUANTUM :]
        for frame in range(QUANTUM):
            share = eased((phase * QUANTUM + frame + 1) / WINDOW) if softly else 1.0
            early[QUANTUM + frame] = late[frame] = share * mix[frame, side]
    place = (convolver.early_place + 1) % EARLY
    _analyse(convolver, early_input, convolver.early[place])
    convolver.early_place = place
    convolver.early_filled = min(convolver.early_filled + 1, EARLY)


@kernel
def _analyse(convolver: Convolver, signals: np.ndarray, spectra: np.ndarray) -> None:
    """Write the spectra (2, 2, half + 1) of two real signals (2, 2 half); move their later halves to the front."""
    n, half = signals.shape[1], signals.shape[1] // 2
    re, im, re2, im2 = _work(convolver, n)
    for frame in range(n):
        re[frame], im[frame] = signals[0, frame], signals[1, frame]
    for side in range(2):
        signal = signals[side]
        for frame in range(half):
            signal[frame] = signal[half + frame]
    transform(re, im, re2, im2, convolver.cosines[:], convolver.sines[:])
    left_re, left_im = spectra[0, 0], spectra[0, 1]
    right_re, right_im = spectra[1, 0], spectra[1, 1]
    for k in range(half + 1):
        mirror = n - k if k > 0 else 0
        left_re[k], left_im[k] = 0.5 * (re[k] + re[mirror]), 0.5 * (im[k] - im[mirror])
        right_re[k], right_im[k] = 0.5 * (im[k] + im[mirror]), 0.5 * (re[mirror] - re[k])


@kernel
def _play(convolver: Convolver, impulse: Impulse, lane: int, later: bool) -> int:
    """Write a quantum of a lane to its part of `wet`; return after how many quanta of silence it has rung out.

    `later`: the lane is needed in the next window too, for which its late partitions are computed.
    """
    channels = impulse.channels
    early = impulse.early
    late = impulse.late
    spectra = reals(address_of(impulse))
    response, sums = shaped(spectra, BEHIND_IMPULSE, (early, channels, 2, QUANTUM + 1)), convolver.early_sums[:]
    count = min(early, convolver.early_filled)
    _multiply(convolver.early[:], convolver.early_place, response[:count], 0, QUANTUM + 1, sums)
    wet = convolver.wet[lane]
    _synthesise(convolver, sums, wet)
    if late > 0:
        for side in range(2):
            convolved = convolver.given[lane, convolver.half, side, convolver.phase * QUANTUM :]
            for frame in range(QUANTUM):
                wet[side, frame] += convolved[frame]
        if later:
            first = BEHIND_IMPULSE + early * channels * 2 * (QUANTUM + 1)
            _compute(convolver, shaped(spectra, first, (late, channels, 2, WINDOW + 1)), lane)
    return early + (late + 4) * WINDOW_QUANTA


@kernel
def _compute(convolver: Convolver, response: np.ndarray, lane: int) -> None:
    """Compute this quantum's part of what the late partitions give in the next window.

    `response`: their spectra, (late, channels, 2, WINDOW + 1).
    """
    phase, sums = convolver.phase, convolver.late_sums[lane]
    count = min(len(response), convolver.late_filled)
    if 1 <= phase <= _SUMMING:
        begin, end = (phase - 1) * _SHARE, min(phase * _SHARE, WINDOW + 1)
        _multiply(_late(convolver), convolver.late_place, response[:count], begin, end, sums)
    elif phase == WINDOW_QUANTA - 2 + lane:
        goal = convolver.given[lane, 1 - convolver.half]
        if count > 0:
            _synthesise(convolver, sums, goal)
        else:
            goal[:] = 0.0


@kernel
def _multiply(spectra: np.ndarray, place: int, response: np.ndarray, begin: int, end: int, sums: np.ndarray) -> None:
    """The sum over partitions of input times response, at some of the frequencies.

    Args:
        spectra: of the input, a ring (partitions, 2, 2, bins), whose latest is at `place`.
        response: (partitions, channels, 2, bins).
        begin, end: the frequencies that are computed, by their numbers.
        sums: (2 sides, 2, bins), in which they are written.
    """
    ring, channels = len(spectra), response.shape[1]
    for side in range(2):
        of = side if channels == 2 else 0
        sum_re, sum_im = sums[side, 0, begin:end], sums[side, 1, begin:end]
        sum_re[:] = 0.0
        sum_im[:] = 0.0
        for partition in range(len(response)):
            slot = (place - partition + ring) % ring
            x_re, x_im = spectra[slot, side, 0, begin:end], spectra[slot, side, 1, begin:end]
            h_re, h_im = response[partition, of, 0, begin:end], response[partition, of, 1, begin:end]
            for k in range(end - begin):
                sum_re[k] += x_re[k] * h_re[k] - x_im[k] * h_im[k]
                sum_im[k] += x_re[k] * h_im[k] + x_im[k] * h_re[k]


@kernel
def _synthesise(convolver: Convolver, spectra: np.ndarray, goal: np.ndarray) -> None:
    """Write the later halves (2, half) of two real signals from their spectra, by one complex transform."""
    half = goal.shape[1]
    n, bins = 2 * half, half + 1
    re, im, re2, im2 = _work(convolver, n)
    left_re, left_im = spectra[0, 0], spectra[0, 1]
    right_re, right_im = spectra[1, 0], spectra[1, 1]
    for k in range(bins):
        re[k], im[k] = left_re[k] - right_im[k], left_im[k] + right_re[k]
    for k in range(1, half):
        re[n - k], im[n - k] = left_re[k] + right_im[k], right_re[k] - left_im[k]
    transform(im, re, im2, re2, convolver.cosines[:], convolver.sines[:])  # exchanged: the inverse
    left, right = goal[0], goal[1]
    for frame in range(half):
        left[frame], right[frame] = re[half + frame], im[half + frame]


@kernel
def _work(convolver: Convolver, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    work = convolver.work[:]
    return work[0, :n], work[1, :n], work[2, :n], work[3, :n]


@kernel
def _mix(convolver: Convolver, mix: np.ndarray, wet_now: bool, wet_next: bool) -> None:
    """Replace the mix by the lane that is heard, or by a fade from it to the next.

    A lane without a response is the mix itself: where `wet_now`, or `wet_next`, is False.
    """
    step, lane = convolver.step, convolver.lane
    now, following = convolver.wet[lane], convolver.wet[1 - lane]
    done = (step - 1) * WINDOW + convolver.phase * QUANTUM
    frames = convolver.fade_windows * WINDOW
    for side in range(2):
        for frame in range(QUANTUM):
            dry = mix[frame, side]
            value = now[side, frame] if wet_now else dry
            if step > 0:
                other = following[side, frame] if wet_next else dry
                value += eased((done + frame + 1) / frames) * (other - value)
            mix[frame, side] = value


@kernel
def begin(convolver: Convolver, rate_hz: float, frames: int) -> None:
    """Set up a convolver, which is all 0, for responses of so many frames."""
    convolver.capacity = late_partitions(frames) + 1
    convolver.fade_windows = math.ceil(FADE_S * rate_hz / WINDOW)
    convolver.step = -1
    fill_circle(convolver.cosines[:], convolver.sines[:])


@kernel
def convolver_slots(frames: int) -> int:
    """The memory of a convolver for responses of so many frames."""
    return BEHIND_CONVOLVER + (late_partitions(frames) + 1) * 4 * (WINDOW + 1)


@kernel
def late_partitions(frames: int) -> int:
    """The partitions of a window's length of a response."""
    return max(0, (frames - EARLY * QUANTUM + WINDOW - 1) // WINDOW)


@kernel
def early_partitions(frames: int) -> int:
    """The partitions of a quantum's length before them."""
    return min(EARLY, (frames + QUANTUM - 1) // QUANTUM)


@kernel
def partitioned_slots(frames: int, channels: int) -> int:
    """The memory of a response in partitions."""
    early, late = early_partitions(frames), late_partitions(frames)
    return BEHIND_IMPULSE + 2 * channels * (early * (QUANTUM + 1) + late * (WINDOW + 1))


@kernel
def partition(work: np.ndarray, response: np.ndarray, frames: int, impulse: Impulse) -> None:
    """Write a response (frames, 1 or 2) as the convolver reads it; the inverse transform's factor is in it.

    Args:
        work: a work space of `fourier` for two windows.
        frames: of it with silence at the end.
        impulse: of `partitioned_slots`.
    """
    impulse.channels = response.shape[1]
    impulse.early, impulse.late = early_partitions(frames), late_partitions(frames)
    memory = reals(address_of(impulse))
    place, first = BEHIND_IMPULSE, 0
    for number in range(impulse.early + impulse.late):
        length = QUANTUM if number < impulse.early else WINDOW
        for channel in range(impulse.channels):
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
