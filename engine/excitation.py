"""Initial displacements of a musician's plucks, and the blow of a hammer.

Plucks are at rest (zero velocity); a blow is a start with speeds alone. Positions and widths are in units of the
string's length, displacement in metres.
"""

from __future__ import annotations

import numpy as np

from engine.resonators.base import Array
from engine.resonators.sine_transform import grid_positions, to_grid


def gaussian(position: float, width: float, peak_m: float, grid_points: int) -> Array:
    """peak · exp(-((x - position)/width)²), float64 (grid_points,), with the ends held at zero."""
    _check_pluck(position, width, peak_m)
    return held(peak_m * np.exp(-(((grid_positions(grid_points) - position) / width) ** 2)))


def triangular(position: float, peak_m: float, grid_points: int) -> Array:
    """A string pulled to a point: straight from both ends to `position`. float64 (grid_points,)."""
    _check_pluck(position, 1.0, peak_m)
    x = grid_positions(grid_points)
    return peak_m * np.minimum(x / position, (1 - x) / (1 - position))


def raised_cosine(position: float, width: float, peak_m: float, grid_points: int) -> Array:
    """A smooth bump peak/2 · (1 + cos(2π(x - position)/width)) of full width `width`. float64 (grid_points,)."""
    _check_pluck(position, width, peak_m)
    distance = (grid_positions(grid_points) - position) / width
    bump = peak_m / 2 * (1 + np.cos(2 * np.pi * distance))
    return held(np.where(np.abs(distance) < 0.5, bump, 0.0))


def rounded(position: float, width: float, peak_m: float, grid_points: int) -> Array:
    """A string pulled by something of a width: a triangle with a round corner. float64 (grid_points,).

    The static shape under a force that is spread as a raised cosine of full width `width`: each mode of the triangle
    times that force's Fourier transform, sinc(μw/2) / (1 - (μw/2)²).
    """
    _check_pluck(position, width, peak_m)
    mu = np.arange(1.0, grid_points - 1)
    half = mu * width / 2
    near = np.abs(half - 1) < 1e-6  # there it is 1/2
    spread = np.where(near, 0.5, np.sinc(half) / np.where(near, 1.0, 1 - half**2))
    shape = to_grid(np.sin(np.pi * mu * position) / mu**2 * spread, grid_points)
    return held(shape * (peak_m / shape.max()))


def release_factor(omega: Array, release_s: float) -> Array:
    """The share left of modes of angular frequencies ω when the pulling force falls to nothing in a time.

    The force falls as a raised cosine does. In a linear string the motion that follows is that of a release at once,
    in the middle of that time, from amplitudes that are smaller by the Fourier transform of the fall's slope: a slow
    release is mellow. (Released by a finger in milliseconds: D. Chadefaux et al., "Experimentally based description
    of harp plucking", JASA 131, 2012.)
    """
    half = omega * (release_s / (2 * np.pi))
    near = np.abs(half - 1) < 1e-6  # there it is 1/2
    return np.where(near, 0.5, np.sinc(half) / np.where(near, 1.0, 1 - half**2))


def blow_factor(omega: Array, shape: Array) -> Array:
    """The factor from a pluck's modal amplitudes to those of a blow on the same width of string.

    A hammer's force for a time τ, a raised cosine, spread over the string as `shape`. A mode then moves as if kicked
    in the pulse's middle, at rest until then, with its spectrum at the mode's frequency, which is `release_factor` of
    τ. Speeds are ω times the amplitudes. The height of the pluck becomes that of the wave which a short blow sends
    out to both sides: the impulse over twice the string's resistance √(TρA). What waves that return do to a hammer
    that still touches is left out. (N. H. Fletcher, T. D. Rossing, "The Physics of Musical Instruments", 2.9.)

    Args:
        omega: of the modes, (modes,), the first partial's first.
        shape: over its height, (grid_points,).
    """
    width = float(shape.sum()) / (len(shape) - 1)  # in lengths of the string
    factor: Array = 2 / (np.pi * width) * omega[0] / omega
    return factor


def held(displacement: Array) -> Array:
    """The displacement (..., grid_points) with the ends held at zero, in place."""
    displacement[..., 0] = displacement[..., -1] = 0
    return displacement


def _check_pluck(position: float, width: float, peak_m: float) -> None:
    if not 0 < position < 1:
        raise ValueError(f"position must lie between 0 and 1 (the fixed ends), not {position}")
    if not width > 0:
        raise ValueError(f"width must be above 0, not {width}")
    if not abs(peak_m) < 1:
        raise ValueError(f"peak displacement must be below 1 m, not {peak_m} m")
