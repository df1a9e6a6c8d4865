"""The transforms between displacement on the grid, modal amplitudes, and displacement at a listening point.

The modes of the simply supported string are sines (the paper's Eq. 2). On a grid with both ends, held at
zero, the transform is a DST-I and exact for up to `grid_points - 2` modes. A modal amplitude here is the
factor in front of sin(μπx/ℓ), in metres; the paper's ȳ is this times ‖K‖² = ℓ/2.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.resonators.base import Array

LARGEST_KEPT = 65_536  # numbers of a table that is remembered: 64 MB of all


def mode_shapes(positions: Array, modes: int) -> Array:
    """sin(μπx) at `positions` (points,) in units of the length: float64 (modes, points)."""
    return np.sin(math.pi * np.arange(1, modes + 1)[:, None] * positions)


def grid_positions(grid_points: int) -> Array:
    """`grid_points` equidistant positions from 0 to 1, both ends included, float64."""
    return np.linspace(0, 1, grid_points)


def synthesis_matrix(grid_points: int, modes: int) -> Array:
    """float64 (modes, grid_points): amplitudes @ synthesis = displacement, with exact zeros at the ends."""
    _check(grid_points, modes)
    if grid_points * modes > LARGEST_KEPT:
        return _sines.__wrapped__(grid_points, modes)
    return _sines(grid_points, modes).copy()


@lru_cache(maxsize=128)  # strings of many pitches have many numbers of modes, on one grid
def _sines(grid_points: int, modes: int) -> Array:
    """The matrix of `synthesis_matrix`, remembered: not to be written."""
    shapes = mode_shapes(grid_positions(grid_points), modes)
    shapes[:, 0] = shapes[:, -1] = 0
    return shapes


def analysis_matrix(grid_points: int, modes: int) -> Array:
    """float64 (grid_points, modes): displacement @ analysis = amplitudes (q = 2/ℓ Δx Σ u sin(μπx/ℓ))."""
    return synthesis_matrix(grid_points, modes).T * (2 / (grid_points - 1))


def to_modes(displacement: NDArray[np.floating], modes: int) -> Array:
    """Displacement (..., grid_points) to modal amplitudes (..., modes), of the same unit."""
    return displacement @ analysis_matrix(displacement.shape[-1], modes)


def to_grid(amplitudes: NDArray[np.floating], grid_points: int) -> Array:
    """Modal amplitudes (..., modes) to displacement (..., grid_points), of the same unit."""
    modes = amplitudes.shape[-1]
    if amplitudes.ndim == 1 and grid_points * modes > LARGEST_KEPT:  # a picture: making its table would take 7 ms
        _check(grid_points, modes)
        turns = np.fft.ifft(np.append(0.0, amplitudes), 2 * (grid_points - 1), norm="forward")
        shape: Array = turns.imag[:grid_points].copy()
        shape[[0, -1]] = 0.0
        return shape
    return amplitudes @ synthesis_matrix(grid_points, amplitudes.shape[-1])


def project(displacement: NDArray[np.floating], modes: int) -> Array:
    """Displacement (..., grid_points) without what lies outside the first `modes` modes."""
    return to_grid(to_modes(displacement, modes), displacement.shape[-1])


def listening_weights(positions: Array, grid_points: int) -> Array:
    """float64 (grid_points, points): displacement @ weights = displacement at `positions` in 0..1.

    Band-limited interpolation with every mode that the grid can hold: on a grid point it picks that point.
    """
    modes = grid_points - 2
    return analysis_matrix(grid_points, modes) @ mode_shapes(positions, modes)


def _check(grid_points: int, modes: int) -> None:
    if not 1 <= modes <= grid_points - 2:
        raise ValueError(f"a grid of {grid_points} points holds 1 to {grid_points - 2} modes, not {modes}")
