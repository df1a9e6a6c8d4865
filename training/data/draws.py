"""Random initial displacements: the paper's protocol (Gaussian, noise), and plucks of a musician.

All of them are at rest, in metres on a grid. Gaussians and noise follow §4.1 of the paper and its authors' ranges.
PyTorch draws the numbers: a seed means the same data for ever.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import torch

from engine.excitation import displacement, held
from engine.kernels.pulses import gaussian
from engine.resonators.base import Array
from engine.resonators.sine_transform import grid_positions

CENTRE_RANGE = (0.3, 0.7)  # of a random Gaussian, in lengths
WIDTH_RANGE = (0.02, 0.1)  # of a random Gaussian, in lengths
PEAK_RANGE_M = (1e-3, 1e-2)  # of both random kinds
PLUCK_POSITION_RANGE = (0.05, 0.95)  # of a random pluck of any shape, in lengths
PLUCK_WIDTH_RANGE = (0.03, 0.3)  # in lengths
PLUCK_PEAK_RANGE_M = (5e-4, 1e-2)


def draw_gaussians(count: int, grid_points: int, generator: torch.Generator) -> Array:
    """`count` random Gaussians of the paper's protocol, float64 (count, grid_points)."""
    centre, width, peak = (_uniform(count, *ends, generator) for ends in (CENTRE_RANGE, WIDTH_RANGE, PEAK_RANGE_M))
    return held(peak * gaussian((grid_positions(grid_points) - centre) / width))


def draw_noise(count: int, grid_points: int, generator: torch.Generator) -> Array:
    """`count` draws of U(0, 1) at each point scaled to a random peak, float64 (count, grid_points)."""
    peak = _uniform(count, *PEAK_RANGE_M, generator)
    raw = torch.rand(count, grid_points, generator=generator, dtype=torch.float64).numpy()
    raw[:, 0] = raw[:, -1] = 0
    return raw / raw.max(1, keepdims=True) * peak


def draw_plucks(count: int, grid_points: int, generator: torch.Generator) -> Array:
    """`count` plucks of a musician: Gaussian, triangular and raised-cosine in turn, float64 (count, grid_points).

    Positions are uniform; widths and peaks are so on a logarithmic scale, because narrow and soft ones count as much.
    """
    position = _uniform(count, *PLUCK_POSITION_RANGE, generator)[:, 0].tolist()
    width, peak_m = (
        np.exp(_uniform(count, math.log(low), math.log(high), generator)[:, 0]).tolist()
        for low, high in (PLUCK_WIDTH_RANGE, PLUCK_PEAK_RANGE_M)
    )
    shapes = itertools.cycle(("gaussian", "triangular", "raised_cosine"))
    plucks = zip(shapes, position, width, peak_m, strict=False)
    return np.stack([displacement(*pluck, grid_points) for pluck in plucks])


DRAWS = {"gaussian": draw_gaussians, "noise": draw_noise, "pluck": draw_plucks}


def _uniform(count: int, low: float, high: float, generator: torch.Generator) -> Array:
    """Uniform draws between two numbers, float64 (count, 1)."""
    return low + (high - low) * torch.rand(count, 1, generator=generator, dtype=torch.float64).numpy()
