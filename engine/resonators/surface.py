"""Modes of a flat surface whose edge is held: circle, rectangle and bar, -∇²φ = κ²φ, φ = 0 at the edge.

    J_m(κr)·cos mθ or sin mθ, κ = j_mn/a          2 sin(mπ(x+1)/2) sin(nπ(y+1)/2), κ² = (mπ/ℓ)² + (nπ/w)²

A bar, n = 0, moves alike across its width: √2 sin(mπ(x+1)/2). Shapes are normalised to ∫φ² dA = A. Places are given
from the centre, in half-lengths: the edge of a circle has x² + y² = 1, that of a rectangle |x| = 1 or |y| = 1.
Source: Morse and Ingard, Theoretical Acoustics (1968), 5.2. Computed by `engine.kernels.drum_modes`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.kernels import drum_modes as kernel
from engine.resonators.base import Array
from engine.values.drum import SHAPES

POINTS = 256  # of an integral; of a bar it converges to 0.1 %, of others to 3e-5


@dataclass(frozen=True, eq=False)
class Surface:
    """A shape, and which of its modes are meant.

    Attributes:
        sides: number of the shape, length and width in m: two diameters of a circle.
        rows: (4, modes): κ times size, m, n or whether it is a sine, and J_m'(κa).
    """

    sides: Array
    rows: Array

    @property
    def round(self) -> bool:
        return bool(self.sides[0] == kernel.CIRCLE)

    @property
    def wavenumber(self) -> Array:
        wavenumber: Array = self.rows[kernel.Z] / kernel.size(self.sides)
        return wavenumber

    @property
    def m(self) -> NDArray[np.int64]:
        """Nodal diameters of a circle, half-waves along a rectangle."""
        return self.rows[kernel.M].astype(np.int64)

    @property
    def n(self) -> NDArray[np.int64]:
        """The half-waves across a rectangle; of a circle 1 for a sine."""
        return self.rows[kernel.N].astype(np.int64)

    def shapes(self, places: Array) -> Array:
        """φ at places (places, 2): float64 (modes, places); 0 beyond the edge."""
        values = np.empty((self.rows.shape[1], len(places)))
        kernel.shapes(self.sides, self.rows, np.ascontiguousarray(places, np.float64), tools(), values)
        return values

    def inside(self, places: Array) -> bool:
        """Return True if all places lie within the edge."""
        away = np.hypot(places[:, 0], places[:, 1]) if self.round else np.abs(places).max(1)
        return bool((away < 1).all())

    def picked(self, index: NDArray[np.int64]) -> Surface:
        """The same with some of the modes."""
        return Surface(self.sides, np.ascontiguousarray(self.rows[:, index]))


def tools() -> kernel.Tools:
    """The kernels' tools: an empty table of Bessel functions, so that they are computed, and work space (ORDERS,)."""
    return np.zeros((0, 0)), np.empty(kernel.ORDERS)


def at_size_1(shape: str, aspect: float) -> Array:
    """The number of a shape, its length and its width (3,), at the area π of a circle of radius 1."""
    round = shape == "circle"
    length = 2.0 if round else math.sqrt(math.pi * aspect)
    return np.array([SHAPES.index(shape), length, length if round else length / aspect])


@lru_cache(maxsize=64)
def modes_below(shape: str, aspect: float, reach: float) -> Array:
    """All modes, rows (4, modes) of `Surface`, with κ up to `reach` at the size of `at_size_1`, by rising κ."""
    if shape == "circle":
        rows = np.empty((int(reach * reach / 4 + reach) + 10, kernel.SURFACE))
        rows = rows[: kernel.zeros(reach, rows, *np.empty((2, int(reach) + 2)), np.empty(kernel.ORDERS))]
        return np.ascontiguousarray(rows[np.lexsort((rows[:, kernel.N], rows[:, kernel.Z]))].T)
    _, length, width = at_size_1(shape, aspect)
    most = [max(1, math.floor(reach * side / math.pi)) for side in (length, width)]
    counts = np.arange(1, most[0] + 1), np.arange(1, most[1] + 1) if shape == "rectangle" else np.zeros(1)
    m, n = (part.ravel() for part in np.meshgrid(*counts, indexing="ij"))
    rows = np.stack([np.hypot(m * math.pi / length, n * math.pi / width), m, n, np.zeros(len(m))])
    rows = rows[:, np.argsort(rows[0], kind="stable")]
    return np.ascontiguousarray(rows[:, rows[0] <= reach])


@lru_cache(maxsize=64)
def air_below(shape: str, aspect: float, reach: float, points: int) -> Array:
    """The effect of the air on the low modes that differ, for ka up to `reach`, to a part in 10¹²: (2, modes, terms).

    Chebyshev polynomials of the square of ka; see `kernel.air_at`.
    """
    sides, low = at_size_1(shape, aspect), modes_below(shape, aspect, kernel.EXACT)
    if shape == "circle":
        low = np.ascontiguousarray(low[:, low[kernel.N] == 0])  # both of a pair are alike
    turns = reach * (1.0 if shape == "circle" else math.hypot(*sides[1:]) / 2)
    terms = math.ceil(turns + 6 * (2 * turns) ** (1 / 3)) + 12  # as a Bessel function's square needs
    angles = (np.arange(terms) + 0.5) * math.pi / terms
    values, work = np.empty((terms, 2, low.shape[1])), np.empty(low.shape[1] + kernel.ORDERS)
    for angle, out in zip(angles, values, strict=True):
        kernel.air_at(sides, low, reach * math.cos(angle / 2), points, out, work)  # even functions of ka
    basis = np.cos(np.outer(np.arange(terms), angles)) * (2 / terms)
    basis[0] /= 2
    pressure: Array = np.ascontiguousarray(np.moveaxis(basis @ values.reshape(terms, -1), 0, -1))
    return pressure.reshape(2, -1, terms)
