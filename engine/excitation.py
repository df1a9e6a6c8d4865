"""Initial displacements: the paper's protocol (Gaussian, noise) and a musician's plucks.

All of them are at rest (zero velocity). Positions and widths are in units of the string's length,
displacement in metres. The random Gaussians and the noise follow §4.1 of the paper and its authors' ranges.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from engine.resonators.sine_transform import grid_positions, to_grid

CENTRE_RANGE = (0.3, 0.7)  # of a random Gaussian, in lengths
WIDTH_RANGE = (0.02, 0.1)  # of a random Gaussian, in lengths
PEAK_RANGE_M = (1e-3, 1e-2)  # of both random kinds
PLUCK_POSITION_RANGE = (0.05, 0.95)  # of a random pluck, which may have any shape
PLUCK_WIDTH_RANGE = (0.03, 0.3)
PLUCK_PEAK_RANGE_M = (5e-4, 1e-2)


def gaussian(position: float, width: float, peak_m: float, grid_points: int) -> Tensor:
    """peak · exp(-((x - position)/width)²), float64 (grid_points,), with the ends held at zero."""
    _check_pluck(position, width, peak_m)
    return _held(peak_m * torch.exp(-(((grid_positions(grid_points) - position) / width) ** 2)))


def triangular(position: float, peak_m: float, grid_points: int) -> Tensor:
    """A string pulled to a point: straight from both ends to `position`. float64 (grid_points,)."""
    _check_pluck(position, 1.0, peak_m)
    x = grid_positions(grid_points)
    return peak_m * torch.minimum(x / position, (1 - x) / (1 - position))


def raised_cosine(position: float, width: float, peak_m: float, grid_points: int) -> Tensor:
    """A smooth bump peak/2 · (1 + cos(2π(x - position)/width)) of full width `width`. float64 (grid_points,)."""
    _check_pluck(position, width, peak_m)
    distance = (grid_positions(grid_points) - position) / width
    bump = peak_m / 2 * (1 + torch.cos(2 * torch.pi * distance))
    return _held(torch.where(distance.abs() < 0.5, bump, 0.0))


def rounded(position: float, width: float, peak_m: float, grid_points: int) -> Tensor:
    """A string pulled by something of a width: a triangle with a round corner. float64 (grid_points,).

    The static shape under a force that is spread as a raised cosine of full width `width`: each mode of the triangle
    times that force's Fourier transform, sinc(μw/2) / (1 - (μw/2)²).
    """
    _check_pluck(position, width, peak_m)
    mu = torch.arange(1, grid_points - 1, dtype=torch.float64)
    half = mu * width / 2
    near = (half - 1).abs() < 1e-6  # there it is 1/2
    spread = torch.where(near, 0.5, torch.sinc(half) / torch.where(near, 1.0, 1 - half.square()))
    shape = to_grid(torch.sin(torch.pi * mu * position) / mu.square() * spread, grid_points)
    return _held(shape * (peak_m / shape.max()))


def draw_gaussians(count: int, grid_points: int, generator: torch.Generator) -> Tensor:
    """`count` random Gaussians of the paper's protocol, float64 (count, grid_points)."""
    centre, width, peak = (
        _uniform(count, low, high, generator) for low, high in (CENTRE_RANGE, WIDTH_RANGE, PEAK_RANGE_M)
    )
    return _held(peak * torch.exp(-(((grid_positions(grid_points) - centre) / width) ** 2)))


def draw_noise(count: int, grid_points: int, generator: torch.Generator) -> Tensor:
    """`count` draws of U(0, 1) at each point scaled to a random peak, float64 (count, grid_points)."""
    peak = _uniform(count, *PEAK_RANGE_M, generator)
    raw = torch.rand(count, grid_points, generator=generator, dtype=torch.float64)
    raw[:, 0] = raw[:, -1] = 0
    return raw / raw.amax(dim=1, keepdim=True) * peak


def draw_plucks(count: int, grid_points: int, generator: torch.Generator) -> Tensor:
    """`count` plucks of a musician: Gaussian, triangular and raised-cosine in turn, float64 (count, grid_points).

    Positions are uniform; widths and peaks are so on a logarithmic scale, because narrow and soft ones count as much.
    """
    position = _uniform(count, *PLUCK_POSITION_RANGE, generator)[:, 0].tolist()
    width, peak_m = (
        _uniform(count, math.log(low), math.log(high), generator)[:, 0].exp().tolist()
        for low, high in (PLUCK_WIDTH_RANGE, PLUCK_PEAK_RANGE_M)
    )
    drawn = []
    for number, (at, wide, peak) in enumerate(zip(position, width, peak_m, strict=True)):
        shape = number % 3
        if shape == 0:
            drawn.append(gaussian(at, wide, peak, grid_points))
        elif shape == 1:
            drawn.append(triangular(at, peak, grid_points))
        else:
            drawn.append(raised_cosine(at, wide, peak, grid_points))
    return torch.stack(drawn)


DRAWS = {"gaussian": draw_gaussians, "noise": draw_noise, "pluck": draw_plucks}


def _uniform(count: int, low: float, high: float, generator: torch.Generator) -> Tensor:
    return low + (high - low) * torch.rand(count, 1, generator=generator, dtype=torch.float64)


def _held(displacement: Tensor) -> Tensor:
    displacement[..., 0] = displacement[..., -1] = 0
    return displacement


def _check_pluck(position: float, width: float, peak_m: float) -> None:
    if not 0 < position < 1:
        raise ValueError(f"position must lie between 0 and 1 (the fixed ends), not {position}")
    if not width > 0:
        raise ValueError(f"width must be above 0, not {width}")
    if not abs(peak_m) < 1:
        raise ValueError(f"peak displacement must be below 1 m, not {peak_m} m")
