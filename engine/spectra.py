"""The distance of two sounds in their spectra, at several resolutions of time and frequency; phases do not count.

Source: Yamamoto, Song, Kim, "Parallel WaveGAN", ICASSP 2020 (arXiv:1910.11480): spectral convergence (after Arık,
Jun, Diamos 2018) and the mean difference of the logarithmic magnitudes, each averaged over the resolutions. Here the
windows are of 512, 1024 and 2048 samples, a quarter of that apart, without padding, and logarithms are in dB.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

SIZES = (512, 1024, 2048)
FLOOR_DB = -80.0  # below the strongest bin of the truth, magnitudes are taken to be equal: what is there is not heard


def spectral_distances(predicted: Tensor, truth: Tensor) -> tuple[Tensor, Tensor]:
    """Distances of sounds (batch, samples): float64 (batch,) each, infinite where a prediction is not finite.

    Sizes that do not fit in the sounds are left out; where none does, the largest power of two that fits is taken.

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
    sizes = [size for size in SIZES if size <= samples] or [2 ** (samples.bit_length() - 1)]
    found = torch.stack([_at_resolution(predicted.double(), truth.double(), size) for size in sizes]).mean(0)
    found.masked_fill_(found.isnan(), math.inf)
    return found[0], found[1]


def _at_resolution(predicted: Tensor, truth: Tensor, size: int) -> Tensor:
    """(2, batch)."""
    window = torch.hann_window(size, dtype=torch.float64, device=truth.device)
    magnitudes = [
        torch.stft(sound, size, max(1, size // 4), window=window, center=False, return_complex=True).abs()
        for sound in (predicted, truth)
    ]
    found, true = magnitudes
    difference, norm = (found - true).square().sum((1, 2)).sqrt(), true.square().sum((1, 2)).sqrt()
    silent = torch.where(difference == 0, 0.0, math.inf).to(norm)
    convergence = torch.where(norm == 0, silent, difference / norm)
    floor = (true.amax((1, 2), keepdim=True) * 10 ** (FLOOR_DB / 20)).clamp(min=torch.finfo(torch.float64).tiny)
    levels = (found.maximum(floor).log10() - true.maximum(floor).log10()).abs() * 20
    return torch.stack([convergence, levels.mean((1, 2))])
