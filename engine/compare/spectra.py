"""The distances of two sounds in their magnitude spectra; phases do not count.

At several resolutions of time and frequency, after Yamamoto, Song, Kim, "Parallel WaveGAN", ICASSP 2020
(arXiv:1910.11480): spectral convergence (after Arık, Jun, Diamos 2018) and the mean difference of the logarithmic
magnitudes, each averaged over the resolutions. Windows are a quarter of their length apart, without padding, and
logarithms are in dB. At one resolution: the log spectral distance of Gray and Markel (IEEE TASSP 24, 1976).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

SIZES = (512, 1024, 2048)
LOG_DISTANCE_SIZE = 2048
FLOOR_DB = -80.0  # below the strongest bin of the truth, magnitudes are taken to be equal: what is there is not heard

Array = NDArray[np.float64]


def magnitudes(sounds: NDArray[np.floating], window: Array, hop: int) -> Array:
    """Magnitude spectra (..., frames, bins) of sounds (..., samples)."""
    frames = np.lib.stride_tricks.sliding_window_view(sounds, len(window), axis=-1)[..., ::hop, :]
    with np.errstate(invalid="ignore"):  # of sounds that are not finite
        return np.abs(np.fft.rfft(frames * window, axis=-1))


def spectral_distances(
    predicted: NDArray[np.floating], truth: NDArray[np.floating], sizes: Sequence[int] = SIZES
) -> tuple[Array, Array]:
    """Distances of sounds (batch, samples): (batch,) each, infinite where a prediction is not finite.

    Sizes of windows that do not fit in the sounds are left out; where none does, the largest power of two that fits
    is taken.

    Returns:
        the spectral convergence ‖|Ŝ| - |S|‖/‖|S|‖, and the mean of |20 log₁₀ |Ŝ|/|S|| in dB.

    Raises:
        ValueError: the shapes differ, or there is no sample.
    """
    if predicted.shape != truth.shape or truth.ndim != 2:
        raise ValueError(f"prediction {tuple(predicted.shape)} and truth {tuple(truth.shape)} differ in shape")
    samples = truth.shape[1]
    if samples < 1:
        raise ValueError("a spectrum needs at least one sample")
    sizes = [size for size in sizes if size <= samples] or [2 ** (samples.bit_length() - 1)]
    convergence, log_db = np.mean([_at_resolution(predicted, truth, size) for size in sizes], axis=0)
    return convergence, log_db


def _at_resolution(predicted: NDArray[np.floating], truth: NDArray[np.floating], size: int) -> Array:
    """Spectral convergence and mean difference in dB, (2, batch), of sounds (batch, samples), in windows of `size`.

    Both are infinite where they are not a number.
    """
    model, true = (magnitudes(sounds, _hann(size), max(1, size // 4)) for sounds in (predicted, truth))
    with np.errstate(divide="ignore", invalid="ignore"):
        difference = np.sqrt(np.square(model - true).sum((1, 2)))
        norm = np.sqrt(np.square(true).sum((1, 2)))
        convergence = np.where(norm == 0, np.where(difference == 0, 0.0, math.inf), difference / norm)
        floor = _floor(true, (1, 2))
        levels_db = 20 * np.abs(np.log10(np.maximum(model, floor)) - np.log10(np.maximum(true, floor)))
    distances = np.stack([convergence, levels_db.mean((1, 2))])
    return np.where(np.isnan(distances), math.inf, distances)


def log_spectral_distance(truth: Array, model: Array, noise_power: float = 0.0) -> float:
    """Root mean square over bins of the difference in dB, mean over frames, of sounds (samples,).

    Levels below the floor, or below the noise where that is higher, count as it.
    """
    window = _hann(LOG_DISTANCE_SIZE)
    missing = max(0, len(window) - len(truth))
    ours, theirs = (magnitudes(np.pad(sound, (0, missing)), window, len(window) // 4) for sound in (model, truth))
    floor = np.maximum(_floor(theirs, (0, 1)), math.sqrt(noise_power * float(window @ window)))
    difference_db = 20 * np.log10(np.maximum(theirs, floor) / np.maximum(ours, floor))
    above_floor = (np.maximum(theirs, ours) > floor).any(axis=0)
    return float(np.sqrt(np.mean(difference_db[:, above_floor] ** 2, axis=1)).mean()) if above_floor.any() else 0.0


def _hann(size: int) -> Array:
    """The periodic Hann window."""
    return np.hanning(size + 1)[:-1] if size > 1 else np.ones(1)


def _floor(true: Array, axes: tuple[int, int]) -> Array:
    """The magnitude FLOOR_DB below the strongest over these axes, which are kept with size 1."""
    strongest = true.max(axes, keepdims=True) * 10 ** (FLOOR_DB / 20)
    return np.asarray(np.maximum(strongest, np.finfo(np.float64).tiny))
