"""Initial displacements of a musician's plucks, and the blow of a hammer.

Plucks are at rest (zero velocity); a blow is a start with speeds alone. Positions and widths are in units of the
string's length, displacement in metres.
"""

from __future__ import annotations

import numpy as np

from engine.kernels import pulses
from engine.resonators.base import Array
from engine.resonators.sine_transform import grid_positions, to_grid


def displacement(shape: str, position: float, width: float, peak_m: float, grid_points: int) -> Array:
    """The displacement of a pluck by the name of its shape, float64 (grid_points,), with the ends held at zero.

    A rounded triangle is the static shape under a force that is spread as a raised cosine of full width `width`; a
    triangle has no width.

    Raises:
        ValueError: a value is out of its range; the message names it.
    """
    if not 0 < position < 1:
        raise ValueError(f"position must lie between 0 and 1 (the fixed ends), not {position}")
    if not width > 0:
        raise ValueError(f"width must be above 0, not {width}")
    if not abs(peak_m) < 1:
        raise ValueError(f"peak displacement must be below 1 m, not {peak_m} m")
    x = grid_positions(grid_points)
    if shape == "rounded":
        height = to_grid(pulses.corner(np.arange(1.0, grid_points - 1), position, width), grid_points)
        height = height / height.max()
    elif shape == "triangular":
        height = pulses.triangle(x, position)
    else:
        height = (pulses.gaussian if shape == "gaussian" else pulses.raised_cosine)((x - position) / width)
    return held(peak_m * height)


def blow_factor(omega: Array, shape: Array) -> Array:
    """The factor from a pluck's modal amplitudes to those of a blow on the same width of string.

    A hammer's force for a time τ, a raised cosine, spread over the string as `shape`. A mode then moves as if kicked
    in the pulse's middle, at rest until then, with its spectrum at the mode's frequency, `pulses.spectrum`. Speeds
    are ω times the amplitudes. The height of the pluck becomes that of the wave which a short blow sends out to both
    sides: the impulse over twice the string's resistance √(TρA). What waves that return do to a hammer that still
    touches is left out. (N. H. Fletcher, T. D. Rossing, "The Physics of Musical Instruments", 2.9.)

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
