"""The audible differences between a model's sound and the truth: spectrum, level, pitch, second pitch; never phase.

The frames of both sounds are long enough that the partials of a low string are apart; the ear separates them up to
the fifth or eighth. Below 20 Hz nothing counts: a string that rests beside its place is not heard.

Source of the log spectral distance: Gray, Markel, "Distance Measures for Speech Processing", IEEE TASSP 24 (1976);
here the mean of the magnitudes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from engine.compare.spectra import magnitudes

FRAME_S = 0.17  # of a spectrum, half of it between two
LOWEST_HZ = 20.0
FLOOR_DB = 60.0  # below the loudest that the truth ever is: what both have there is equal
EARLY_S = 0.25  # the ear takes a level over about this time
RISE_S = 0.5  # between the levels that show a model's own growth
LOW_PARTIALS = 6  # one of them is the strongest
WEAK_DB = 30.0  # a partial so far below the truth has no pitch that means anything
SECOND_DB = 19.0  # a peak so far below the first makes the level swing by 2 dB, 20 log₁₀ (1 + r)/(1 - r)
HANN_WIDTH = 1.5  # frequencies over which a Hann window spreads the power of one
DIP_DB = 3.0  # between two peaks that are two

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AudibleErrors:
    """A model's sound against the true one.

    Attributes:
        distance_db: the mean of |10 log₁₀ P̂/P| over frames and frequencies where either is not silent; 60 at most.
        level_db: how much louder it is in the last quarter than it should be, against how much it was at first.
        rise_db: how far its own level rises above an earlier one.
        pitch_cents: of the truth's strongest low partial, past `after_s`, as a tuner reads it; None: it is not there.
        split_cents: from that pitch to a second one beside it, where the truth has one alone; None: it is one.
    """

    distance_db: float
    level_db: float
    rise_db: float
    pitch_cents: float | None
    split_cents: float | None


def audible_errors(
    model: NDArray[np.floating],
    truth: NDArray[np.floating],
    rate_hz: int,
    partials_hz: Sequence[float],
    after_s: float,
) -> AudibleErrors:
    """The errors of a sound.

    Args:
        model, truth: (samples,), finite, in one unit.
        partials_hz: of the string at rest, the lowest first; pitch is looked for half-way to their neighbours.
        after_s: pitch is of what comes then: what a string glides at first is no error of pitch.

    Raises:
        ValueError: the shapes differ, or the sounds are shorter than a frame.
    """
    if model.shape != truth.shape or truth.ndim != 1:
        raise ValueError(f"model {tuple(model.shape)} and truth {tuple(truth.shape)} differ in shape")
    if len(truth) < frame_length(rate_hz):
        raise ValueError(f"{len(truth)} samples are less than a frame of {frame_length(rate_hz)}")
    sounds = [np.asarray(sound, np.float64) for sound in (model, truth)]
    ours, theirs = (_spectra(sound, rate_hz) for sound in sounds)
    found_level, true_level = (np.maximum(power.sum(1), np.finfo(np.float64).tiny) for power in (ours, theirs))
    first = min(round(after_s * rate_hz), len(truth) // 2)
    pitch, split = _pitch(sounds[0][first:], sounds[1][first:], rate_hz, partials_hz)
    return AudibleErrors(
        distance_db=_distance(ours, theirs),
        level_db=_level_change(found_level, true_level, rate_hz),
        rise_db=_rise(found_level, true_level, rate_hz),
        pitch_cents=pitch,
        split_cents=split,
    )


def heard_level_db(sound: NDArray[np.floating], rate_hz: int) -> float:
    """The level of a stationary sound (samples,) as a sine's amplitude, in dB of full scale ±1; -200 if silent."""
    window = np.hanning(len(sound))
    amplitudes = np.abs(np.fft.rfft((sound - np.mean(sound)) * window)) * 2 / window.sum()
    power = float(np.square(amplitudes[math.ceil(LOWEST_HZ * len(sound) / rate_hz) :]).sum()) / HANN_WIDTH
    return 10 * math.log10(max(power, 1e-20))


def frame_length(rate_hz: int) -> int:
    """Samples of a frame: even, so that half of it is a hop."""
    return 2 * round(FRAME_S * rate_hz / 2)


def _spectra(sound: Array, rate_hz: int) -> Array:
    """Power (frames, frequencies from LOWEST_HZ on) of a sound (samples,)."""
    length = frame_length(rate_hz)
    first = math.ceil(LOWEST_HZ * length / rate_hz)
    return np.square(magnitudes(sound, np.hanning(length), length // 2)[:, first:])


def _distance(model: Array, true: Array) -> float:
    """The `distance_db` of powers (frames, frequencies); 0 where both are silent."""
    floor = max(float(true.max()) * 10 ** (-FLOOR_DB / 10), np.finfo(np.float64).tiny)
    above_floor = (model > floor) | (true > floor)
    if not above_floor.any():
        return 0.0
    levels = [10 * np.log10(np.maximum(power[above_floor], floor)) for power in (model, true)]
    return _within_floor(float(np.abs(levels[0] - levels[1]).mean()))


def _level_change(model: Array, true: Array, rate_hz: int) -> float:
    """The `level_db` of powers by frame, (frames,): the excess in the last quarter less that in the first EARLY_S."""
    early = max(1, round(EARLY_S / _hop_s(rate_hz)) - 1)
    late = -max(1, len(true) // 4)
    first, last = (
        10 * (math.log10(model[part].mean()) - math.log10(true[part].mean()))
        for part in (slice(early), slice(late, None))
    )
    return _within_floor(last - first)


def _rise(power: Array, true: Array, rate_hz: int) -> float:
    """The largest rise in dB of a model's level, in means over RISE_S of its powers by frame, (frames,).

    What lies FLOOR_DB below the loudest frame of the truth does not count.
    """
    length = max(1, round(RISE_S / _hop_s(rate_hz)))
    count = max(1, len(power) // length)
    means = np.array([part.mean() for part in np.array_split(power, count)])
    level = 10 * np.log10(np.maximum(means, true.max() * 10 ** (-FLOOR_DB / 10)))
    return _within_floor(float((level - np.minimum.accumulate(level)).max()))


def _within_floor(decibels: float) -> float:
    """The decibels, held within ±FLOOR_DB."""
    return min(max(decibels, -FLOOR_DB), FLOOR_DB)


def _hop_s(rate_hz: int) -> float:
    return frame_length(rate_hz) / 2 / rate_hz


def _pitch(
    model: Array, truth: Array, rate_hz: int, partials_hz: Sequence[float]
) -> tuple[float | None, float | None]:
    """The error in cents, and the distance of a second pitch, as in `AudibleErrors`.

    Args:
        model, truth: sounds (samples,) past the glide.
    """
    size = 4 * 2 ** math.ceil(math.log2(len(truth)))  # samples of the transform, padded with zeros
    window = np.hanning(len(truth))
    ours, theirs = (np.square(np.abs(np.fft.rfft(sound * window, size))) for sound in (model, truth))
    bands = [
        slice(math.ceil(low / rate_hz * size), math.floor(high / rate_hz * size) + 1)
        for low, high in _bands(partials_hz, rate_hz)
    ]
    band = max(bands, key=lambda band: float(theirs[band].max()), default=slice(0))
    found_peaks, true_peaks = (_peaks(power[band]) for power in (ours, theirs))
    if not true_peaks or not found_peaks or found_peaks[0][1] < true_peaks[0][1] * 10 ** (-WEAK_DB / 10):
        return None, None
    true_pitch, *pitches = (band.start + place for place, _ in (true_peaks[0], *found_peaks))
    cents = 1200 * math.log2(pitches[0] / true_pitch)
    split = len(true_peaks) == 1 and len(pitches) > 1
    return cents, abs(1200 * math.log2(pitches[1] / pitches[0])) if split else None


def _bands(partials_hz: Sequence[float], rate_hz: int) -> list[tuple[float, float]]:
    """The bands around each low partial, to the middles between it and its neighbours."""
    known = [0.0, *(hz for hz in partials_hz[: LOW_PARTIALS + 1] if hz < rate_hz / 2)]
    edges = [(a + b) / 2 for a, b in pairwise(known)]
    edges.append(min(known[-1] + (known[-1] - edges[-1]), rate_hz / 2) if edges else 0.0)
    return list(pairwise(edges))[:LOW_PARTIALS]


def _peaks(power: Array) -> list[tuple[float, float]]:
    """The (place, power) of the highest peak, and of the next that is nearly as high and that a dip parts from it.

    Args:
        power: by frequency, (bins,), in which places are counted; no or one peak may be there.
    """
    if len(power) < 3 or power.max() <= 0:
        return []
    inner = power[1:-1]
    places = np.flatnonzero((inner > power[:-2]) & (inner >= power[2:])) + 1
    places = places[power[places] >= power.max() * 10 ** (-SECOND_DB / 10)]
    kept: list[int] = []
    for place in sorted(places, key=lambda at: -power[at]):
        dips = (power[min(place, other) : max(place, other)].min() for other in kept)
        if all(dip < power[place] * 10 ** (-DIP_DB / 10) for dip in dips):
            kept.append(place)
        if len(kept) == 2:
            break
    return [_refined(power, place) for place in kept]


def _refined(power: Array, place: int) -> tuple[float, float]:
    """Refine the place and power of a peak by a parabola through the logarithms of three."""
    left, middle, right = np.log(np.maximum(power[place - 1 : place + 2], np.finfo(np.float64).tiny))
    bend = left - 2 * middle + right
    return place + (0.5 * (left - right) / bend if bend < 0 else 0.0), float(power[place])
