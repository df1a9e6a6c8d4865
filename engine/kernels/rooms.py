"""The impulse response of a box of six walls, without its direct sound; see `engine.effects.room`."""

from __future__ import annotations

import math

import numpy as np

from engine.kernels import constants as of
from engine.kernels.compiled import kernel
from engine.kernels.fourier import ONE, TWO, power_of_two, row, silence, turn
from engine.kernels.responses import fade, high_pass, level, load, resample, store

SPEED_M_S = 343.0
SIDES_M = (5.6, 4.3, 2.8)  # at a T60 of half a second; they grow with its root
SOURCE, LISTENER = (0.36, 0.42, 0.43), (0.61, 0.55, 0.50)  # in sides
APART_M = 0.35  # of the two microphones
MIXING_S = 3e-3  # times the root of the volume in m³
BANDS_HZ = (125.0, 500.0, 2_000.0, 8_000.0)
BANDS_T60 = (1.15, 1.0, 0.8, 0.4)  # times the T60: the decay of each band
SUBSONIC_HZ = 40.0


@kernel
def room_frames(t60_s: float) -> int:
    """The length of a room's response at ROOM_HZ."""
    return int(np.rint(t60_s * of.ROOM_HZ))


@kernel
def respond(work: np.ndarray, t60_s: float, made: np.ndarray, rate_hz: float, sound: np.ndarray) -> None:
    """Write the response of a room: reflections of its walls at first, then decaying noise.

    Args:
        work: a work space of `fourier`, (ROWS, N).
        t60_s: the time in which sound decays by 60 dB.
        made: (`room_frames`, 2), independent noise of power 1; it is overwritten.
        sound: its response at `rate_hz`, (frames, 2).
    """
    grown = math.sqrt(t60_s / 0.5)  # the sides, times SIDES_M
    volume_m3 = SIDES_M[0] * SIDES_M[1] * SIDES_M[2] * grown**3
    mixing_s = MIXING_S * math.sqrt(volume_m3)
    direct_m = _reflect(work, grown, mixing_s, len(made))
    early_left, early_right = row(work, ONE, len(made)), row(work, ONE + 1, len(made))
    # The root of the power of all reflections in a frame; the direct sound has the power 1
    late = direct_m * math.sqrt(4 * math.pi * SPEED_M_S / volume_m3 / of.ROOM_HZ)
    for frame in range(len(made)):
        # From reflections (0) to noise (π/2), between half of the mixing time and all of it
        turn = min(max(2 * (frame / of.ROOM_HZ) / mixing_s - 1, 0.0), 1.0) * (math.pi / 2)
        cosine, sine = math.cos(turn), late * math.sin(turn)
        made[frame, 0] = early_left[frame] * cosine + made[frame, 0] * sine
        made[frame, 1] = early_right[frame] * cosine + made[frame, 1] * sine
    _decay(work, made, t60_s)
    high_pass(work, made, SUBSONIC_HZ, of.ROOM_HZ)
    fade(made)
    resample(work, made, of.ROOM_HZ, rate_hz, sound)
    level(work, sound, rate_hz)


@kernel
def _reflect(work: np.ndarray, grown: float, until_s: float, frames: int) -> float:
    """Write the reflections of walls that reflect all, and return the length of the direct sound's path in m.

    They are signal ONE of `work`: the left microphone's in row ONE, the right one's in row ONE + 1. Frame 0 is the
    arrival of the direct sound, whose height would be 1 and which is left out.

    Args:
        grown: a factor: the room's sides over SIDES_M.
        until_s: the time after which no reflections are written.
        frames: the length of both rows.
    """
    square = 0.0
    for axis in range(3):
        square += (grown * SIDES_M[axis] * (SOURCE[axis] - LISTENER[axis])) ** 2
    direct_m = math.sqrt(square)
    silence(work, ONE, 0, frames)
    last = min(float(frames), until_s * of.ROOM_HZ)
    # Periods of two sides, to either direction of each axis, in which images of the source are looked for
    furthest = math.ceil((until_s * SPEED_M_S + direct_m) / (2 * grown * min(SIDES_M))) + 1
    images = 2 * (2 * furthest + 1)  # of an axis: in each period one as the source is, and one mirrored
    for x in range(images):
        for y in range(images):
            for z in range(images):
                apart_m = _apart(x, 0, furthest, grown), _apart(y, 1, furthest, grown), _apart(z, 2, furthest, grown)
                if x == y == z == 2 * furthest:
                    continue  # the source itself
                for side in range(2):
                    along_m = apart_m[1] - (side - 0.5) * APART_M
                    way_m = math.sqrt(apart_m[0] ** 2 + along_m**2 + apart_m[2] ** 2)
                    place = (way_m - direct_m) / SPEED_M_S * of.ROOM_HZ  # in frames, not whole
                    if 0 <= place < last:
                        _add(row(work, ONE + side, frames), place, direct_m / way_m)
    return direct_m


@kernel
def _apart(number: int, axis: int, furthest: int, grown: float) -> float:
    """The distance from listener to image along an axis in m; image number `2 furthest` is the source itself.

    Odd numbers are mirrored images. `grown` is the room's sides over SIDES_M.
    """
    mirrored = -1.0 if number % 2 else 1.0
    return grown * SIDES_M[axis] * (2 * (number // 2 - furthest) + mirrored * SOURCE[axis] - LISTENER[axis])


@kernel
def _add(sound: np.ndarray, place: float, height: float) -> None:
    """Add a sample of a height to a sound (frames,) at a place between two frames, shared out linearly."""
    before = int(place)
    sound[before] += (1 - (place - before)) * height
    if before + 1 < len(sound):
        sound[before + 1] += (place - before) * height


@kernel
def _decay(work: np.ndarray, sound: np.ndarray, t60_s: float) -> None:
    """Give each band of a sound (frames, 2) its own decay; bands overlap, and their sum is the whole spectrum.

    Signals ONE (a band) and TWO (the sum) of `work` are used.
    """
    size = power_of_two(2 * len(sound))
    re, im = row(work, ONE, size), row(work, ONE + 1, size)
    total_re, total_im = row(work, TWO, size), row(work, TWO + 1, size)
    silence(work, TWO, 0, size)
    for band in range(len(BANDS_HZ)):
        load(work, ONE, sound, size)
        rate = math.log(1000) / (t60_s * BANDS_T60[band])
        for frame in range(len(sound)):
            fall = math.exp(-rate * (frame / of.ROOM_HZ))
            re[frame] *= fall
            im[frame] *= fall
        turn(work, ONE, ONE + 1, size)
        for k in range(size // 2 + 1):
            share, mirror = _share(band, k * of.ROOM_HZ / size), (size - k) % size
            total_re[k] += share * re[k]
            total_im[k] += share * im[k]
            if mirror != k:
                total_re[mirror] += share * re[mirror]
                total_im[mirror] += share * im[mirror]
    store(work, TWO, sound, size)


@kernel
def _share(band: int, hz: float) -> float:
    """The share of a band in a frequency, 0 … 1: falling linearly, in octaves, to 0 at the middles of its neighbours.

    The first band has all below its middle, the last one all above.
    """
    before, after = BANDS_HZ[max(band - 1, 0)], BANDS_HZ[min(band + 1, len(BANDS_HZ) - 1)]
    if hz < BANDS_HZ[band]:
        return (
            max(1 - math.log(BANDS_HZ[band] / max(hz, 1.0)) / math.log(BANDS_HZ[band] / before), 0.0) if band else 1.0
        )
    if band + 1 < len(BANDS_HZ):
        return max(1 - math.log(hz / BANDS_HZ[band]) / math.log(after / BANDS_HZ[band]), 0.0)
    return 1.0
