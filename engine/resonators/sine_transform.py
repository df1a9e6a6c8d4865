"""Between displacement on the grid, modal amplitudes, and displacement at a listening point.

The modes of the simply supported string are sines (the paper's Eq. 2). On a grid with both ends, held at
zero, the transform is a DST-I and exact for up to `grid_points - 2` modes. A modal amplitude here is the
factor in front of sin(μπx/ℓ), in metres; the paper's ȳ is this times ‖K‖² = ℓ/2.
"""

from __future__ import annotations

import math
from functools import lru_cache

import torch
from torch import Tensor

LARGEST_KEPT = 65_536  # numbers of a table that is remembered: 64 MB of all


def mode_shapes(positions: Tensor, modes: int) -> Tensor:
    """sin(μπx) at `positions` (points,) in units of the length: float64 (modes, points)."""
    mu = torch.arange(1, modes + 1, dtype=torch.float64)
    return torch.sin(math.pi * mu[:, None] * positions.to(torch.float64)[None, :])


def grid_positions(grid_points: int) -> Tensor:
    """`grid_points` equidistant positions from 0 to 1, both ends included, float64."""
    return torch.linspace(0, 1, grid_points, dtype=torch.float64)


def synthesis_matrix(grid_points: int, modes: int) -> Tensor:
    """float64 (modes, grid_points): amplitudes @ synthesis = displacement, with exact zeros at the ends."""
    _check(grid_points, modes)
    if grid_points * modes > LARGEST_KEPT:
        return _sines.__wrapped__(grid_points, modes)
    return _sines(grid_points, modes).clone()


@lru_cache(maxsize=128)  # strings of many pitches have many numbers of modes, on one grid
def _sines(grid_points: int, modes: int) -> Tensor:
    shapes = mode_shapes(grid_positions(grid_points), modes)
    shapes[:, 0] = shapes[:, -1] = 0
    return shapes


def analysis_matrix(grid_points: int, modes: int) -> Tensor:
    """float64 (grid_points, modes): displacement @ analysis = amplitudes (q = 2/ℓ Δx Σ u sin(μπx/ℓ))."""
    return synthesis_matrix(grid_points, modes).T * (2 / (grid_points - 1))


def to_modes(displacement: Tensor, modes: int) -> Tensor:
    """Displacement (..., grid_points) to modal amplitudes (..., modes), same dtype and unit."""
    return displacement @ analysis_matrix(displacement.shape[-1], modes).to(displacement)


def to_grid(amplitudes: Tensor, grid_points: int) -> Tensor:
    """Modal amplitudes (..., modes) to displacement (..., grid_points), same dtype and unit."""
    return amplitudes @ synthesis_matrix(grid_points, amplitudes.shape[-1]).to(amplitudes)


def listening_weights(positions: Tensor, grid_points: int) -> Tensor:
    """float64 (grid_points, points): displacement @ weights = displacement at `positions` in 0..1.

    Band-limited interpolation with every mode that the grid can hold: on a grid point it picks that point.
    """
    modes = grid_points - 2
    return analysis_matrix(grid_points, modes) @ mode_shapes(positions, modes)


def _check(grid_points: int, modes: int) -> None:
    if not 1 <= modes <= grid_points - 2:
        raise ValueError(f"a grid of {grid_points} points holds 1 to {grid_points - 2} modes, not {modes}")
