"""Measures notes of known times in a recording: pitch, loudness, decay and damping.

Sounds are float arrays (frames, channels) at `RATE_HZ`. Times are in s from the beginning of the array, at which a
note is heard, with the latency already taken into account.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.kernels.constants import PART_S
from tests.bench.play.sound_server import RATE_HZ
from tests.bench.tune import loudness_db, pitch_hz

ATTACK_S = 0.15  # at the beginning of a note, in which its pitch is not measured
SHORTEST_S = 0.1  # of sound in which a pitch can be measured
LEVEL_S, HOP_S = 0.02, 0.005
DAMPER_S = 0.03  # from the release of a key until its damper is down
FALL_DB = 40.0  # over which a release is measured
LONGEST_RELEASE_S = 0.4
AUDIBLE_DB = -90.0  # relative to full scale
TONE_DB = 20.0  # that a tone of a chord must exceed the spectrum a quarter tone beside it
STRIKE_S = 0.03  # of sound before and after a strike, whose levels are compared
STRUCK_S = (0.015, 0.115)  # after a strike that stops its string: the sound whose level is that of the strike

Sound = NDArray[np.float32]


def cents(sound: Sound, begins_s: float, ends_s: float, wanted_hz: float) -> float:
    """Deviation of a note's first partial from the wanted pitch; NaN for silence and where the span is too short."""
    part = _part(sound, begins_s, ends_s)[:, 0]
    if ends_s - begins_s < SHORTEST_S:
        return float("nan")
    return float(1200 * np.log2(pitch_hz(part, wanted_hz, RATE_HZ) / wanted_hz))


def loudness(sound: Sound, begins_s: float) -> float:
    """K-weighted level of a note's first 0.4 s, in dB relative to full scale."""
    return loudness_db(_part(sound, begins_s, begins_s + PART_S), RATE_HZ)


def tone_stands_out(sound: Sound, begins_s: float, ends_s: float, wanted_hz: float) -> bool:
    """Whether a partial of the wanted pitch sounds among other tones."""
    part = _part(sound, begins_s + ATTACK_S, ends_s)[:, 0].astype(np.float64)
    spectrum = np.abs(np.fft.rfft(part * np.hanning(len(part))))
    bin_hz = RATE_HZ / len(part)

    def level(hz: float) -> float:
        place = round(hz / bin_hz)
        return float(spectrum[place - 1 : place + 2].max())

    beside = max(level(wanted_hz * 2 ** (step / 24)) for step in (-1, 1))
    return level(wanted_hz) > beside * 10 ** (TONE_DB / 20)


def slope_db_s(sound: Sound, begins_s: float, ends_s: float) -> float:
    """How fast the level falls, in dB/s, by a straight line fitted to it."""
    levels = levels_db(sound, begins_s, ends_s)
    return float(-np.polyfit(np.arange(len(levels)) * HOP_S, levels, 1)[0])


def release_t60_s(sound: Sound, damped_s: float, own_slope_db_s: float) -> float:
    """T60 of a damper alone, without the string's own decay; NaN where there is too little sound to tell.

    Args:
        damped_s: when the key is released.
        own_slope_db_s: of the string before, in dB/s.
    """
    levels = levels_db(sound, damped_s + DAMPER_S, damped_s + LONGEST_RELEASE_S)
    low = np.flatnonzero(levels < max(levels[0] - FALL_DB, AUDIBLE_DB))
    count = int(low[0]) if len(low) else len(levels)
    if count < 4:
        return float("nan")
    slope = -np.polyfit(np.arange(count) * HOP_S, levels[:count], 1)[0]
    return float(60 / (slope - own_slope_db_s)) if slope > own_slope_db_s else float("inf")


def change_db(sound: Sound, strike_s: float) -> float:
    """Change of the level from right before a strike to right after it."""
    before = _power(_part(sound, strike_s - STRIKE_S - 0.002, strike_s - 0.002))
    after = _power(_part(sound, strike_s + 0.002, strike_s + 0.002 + STRIKE_S))
    return float(10 * np.log10(after / before))


def struck_db(sound: Sound, strike_s: float) -> float:
    """Level of a strike that stops its string, in dB relative to full scale."""
    return float(10 * np.log10(_power(_part(sound, *(strike_s + each for each in STRUCK_S)))))


def levels_db(sound: Sound, begins_s: float, ends_s: float) -> NDArray[np.float64]:
    """Levels, mean squares over 20 ms, one every 5 ms, in dB relative to full scale."""
    part = _part(sound, begins_s, ends_s)
    size, hop = round(LEVEL_S * RATE_HZ), round(HOP_S * RATE_HZ)
    powers = [_power(part[start : start + size]) for start in range(0, len(part) - size + 1, hop)]
    return 10 * np.log10(np.array(powers))


def _power(part: Sound) -> float:
    return max(float((part.astype(np.float64) ** 2).mean()), 1e-30)


def _part(sound: Sound, begins_s: float, ends_s: float) -> Sound:
    return sound[round(begins_s * RATE_HZ) : round(ends_s * RATE_HZ)]
