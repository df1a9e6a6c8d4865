"""A gentle room: the stereo impulse response of a box of six walls, without its direct sound.

Early reflections are its image sources (J. B. Allen and D. A. Berkley, "Image method for efficiently simulating
small-room acoustics", J. Acoust. Soc. Am. 65 (1979) 943). Their number grows with the square of time, so that they
soon are noise of a known power, 4πc/V a second at a metre from the source; it takes over at the mixing time. Both
decay with a T60 that falls with frequency, as air and walls have it.

Why a response and not a network of delays: it goes through the one convolution that the body needs anyway, is the
same to the sample in a file, and rings on unchanged while it is exchanged.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine import bounds
from engine.effects.impulse import as_loud, faded, resampled, room_for, without_subsonic

RATE_HZ = 48_000  # at which it is made, so that it is the same room at any rate
SPEED_M_S = 343.0
SIDES_M = np.array([5.6, 4.3, 2.8])  # at a T60 of half a second; they grow with its root
SOURCE, LISTENER = np.array([0.36, 0.42, 0.43]), np.array([0.61, 0.55, 0.50])  # in sides
APART_M = 0.35  # of the two microphones
MIXING_S = 3e-3  # times the root of the volume in m³
BANDS_HZ = (125.0, 500.0, 2_000.0, 8_000.0)
BANDS_T60 = (1.15, 1.0, 0.8, 0.4)  # times the T60
SUBSONIC_HZ = 40.0
_SEED = 1


@lru_cache(maxsize=8)
def room_response(t60_s: float, rate_hz: int) -> NDArray[np.float64]:
    """The response of the reverberation alone, (frames, 2), as loud as what it is given; not to be written."""
    sides_m = SIDES_M * math.sqrt(t60_s / 0.5)
    volume_m3 = float(sides_m.prod())
    mixing_s = MIXING_S * math.sqrt(volume_m3)
    frames = round(t60_s * RATE_HZ)
    time_s = np.arange(frames) / RATE_HZ
    early, direct_m = _images(sides_m, mixing_s, frames)
    late = room_noise(frames) * direct_m * math.sqrt(4 * math.pi * SPEED_M_S / volume_m3 / RATE_HZ)
    turn = np.clip(2 * time_s / mixing_s - 1, 0.0, 1.0)[:, None] * (np.pi / 2)
    found = _decayed(early * np.cos(turn) + late * np.sin(turn), time_s, t60_s)
    found = without_subsonic(found, SUBSONIC_HZ, RATE_HZ)
    found = as_loud(resampled(faded(found), RATE_HZ, rate_hz), rate_hz)
    found.setflags(write=False)
    return found


def room_noise(frames: int) -> NDArray[np.float64]:
    """Noise of power 1, (frames, 2), from which late reflections are made by decay: the same in every room."""
    return np.random.default_rng(_SEED).standard_normal((round(bounds.ROOM_T60_S[1] * RATE_HZ), 2))[:frames]


def _images(sides_m: NDArray[np.float64], until_s: float, frames: int) -> tuple[NDArray[np.float64], float]:
    """The reflections of walls that reflect all, (frames, 2), and the direct sound's way in m.

    They start when the direct sound arrives as 1.
    """
    source_m, listener_m = SOURCE * sides_m, LISTENER * sides_m
    direct_m = float(np.linalg.norm(source_m - listener_m))
    furthest = math.ceil((until_s * SPEED_M_S + direct_m) / (2 * float(sides_m.min()))) + 1
    turns = np.arange(-furthest, furthest + 1)
    axes = [np.concatenate([2 * turns * side + place, 2 * turns * side - place])
            for side, place in zip(sides_m, source_m, strict=True)]  # fmt: skip
    images_m = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    images_m = images_m[np.linalg.norm(images_m - source_m, axis=1) > 1e-6]
    found = np.zeros((frames + 1, 2))
    for side, offset_m in enumerate((-APART_M / 2, APART_M / 2)):
        ways_m = np.linalg.norm(images_m - listener_m - np.array([0.0, offset_m, 0.0]), axis=1)
        place = (ways_m - direct_m) / SPEED_M_S * RATE_HZ
        heard = (place >= 0) & (place < min(frames, until_s * RATE_HZ))
        before = place[heard].astype(int)
        share = place[heard] - before
        np.add.at(found[:, side], before, (1 - share) * direct_m / ways_m[heard])
        np.add.at(found[:, side], before + 1, share * direct_m / ways_m[heard])
    return found[:-1], direct_m


def _decayed(found: NDArray[np.float64], time_s: NDArray[np.float64], t60_s: float) -> NDArray[np.float64]:
    """The reflections with each band's own decay; bands overlap, and are the whole together."""
    size = room_for(2 * len(found))
    octaves = np.log2(np.maximum(np.fft.rfftfreq(size, 1 / RATE_HZ), 1.0))
    total = np.zeros((size // 2 + 1, 2), complex)
    for band, ratio in enumerate(BANDS_T60):
        share = np.interp(octaves, np.log2(BANDS_HZ), np.eye(len(BANDS_HZ))[band])
        decay = np.exp(-math.log(1000) / (t60_s * ratio) * time_s)
        total += share[:, None] * np.fft.rfft(found * decay[:, None], size, axis=0)
    return np.fft.irfft(total, size, axis=0)[: len(found)]
