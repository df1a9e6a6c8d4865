"""Modes of a flat surface whose edge is held: circle and rectangle, -∇²φ = κ²φ, φ = 0 at the edge.

Shapes are normalised to ∫φ² dA = A. Places are given from the centre, in half-lengths: the edge of a circle has
x² + y² = 1, that of a rectangle |x| = 1 or |y| = 1. Source: Morse and Ingard, Theoretical Acoustics (1968), 5.2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np
import scipy  # whose special functions are loaded by the first circle: a quarter of a second
from numpy.typing import NDArray

from engine.resonators.base import Array

Numbers = NDArray[np.int64]


class Surface(Protocol):
    """A shape, and which of its modes are meant: attributes are of the surface or (modes,)."""

    @property
    def area_m2(self) -> float: ...

    @property
    def wavenumber(self) -> Array: ...

    def shapes(self, places: Array) -> Array:
        """φ at places (places, 2): float64 (modes, places)."""

    def inside(self, places: Array) -> bool:
        """Whether all places lie within the edge."""

    def transform(self, wavenumbers: Array, angle: Array | float) -> Array:
        """|∫φ e^{is·x} dA|/A with its sign, for vectors s of a wavenumber (modes,) each and a direction, (modes,)."""

    def density(self, wavenumbers: Array) -> Array:
        """The share of each mode's square at wavenumbers (modes, n) in 1/m, over all directions: ∫ density ds = 1."""

    @property
    def distinct(self) -> tuple[Numbers, Numbers]:
        """The modes whose `density` differs from all others', and which of these each mode (modes,) equals."""

    def picked(self, index: Numbers) -> Surface:
        """The same with some of the modes."""


def _zeros(m: int, count: int) -> Array:
    """The first zeros of J_m, at least so many; remembered."""
    return _known_zeros(m, 1 << (count - 1).bit_length())


@lru_cache(maxsize=1024)
def _known_zeros(m: int, count: int) -> Array:
    found: Array = scipy.special.jn_zeros(m, count)
    return found


@dataclass(frozen=True, eq=False)
class Circle:
    """J_m(κr)·cos mθ or sin mθ, κ = j_mn/a; see `Surface`."""

    radius_m: float
    m: Numbers  # nodal diameters
    sine: NDArray[np.bool_]
    wavenumber: Array

    @classmethod
    def below(cls, radius_m: float, wavenumber: float) -> Circle:
        """All modes up to a wavenumber, by rising wavenumber; of a pair the cosine comes first."""
        highest, rows = wavenumber * radius_m, []
        m = 0
        while True:
            zeros = _zeros(m, max(1, math.ceil((highest - m) / math.pi) + 2))
            zeros = zeros[zeros <= highest]
            if len(zeros) == 0:
                break
            rows += [(zero, m, sine) for zero in zeros for sine in ((False, True) if m else (False,))]
            m += 1
        rows.sort(key=lambda row: (row[0], row[2]))
        zeros, orders, sines = (
            (np.array(column) for column in zip(*rows, strict=True)) if rows else (np.zeros(0),) * 3
        )
        return cls(radius_m, orders.astype(np.int64), sines.astype(bool), zeros / radius_m)

    @property
    def area_m2(self) -> float:
        return math.pi * self.radius_m**2

    def shapes(self, places: Array) -> Array:
        r, angle = np.hypot(places[:, 0], places[:, 1]), np.arctan2(places[:, 1], places[:, 0])
        z = self.wavenumber[:, None] * self.radius_m
        distances, place = np.unique(r, return_inverse=True)  # a grid has few: Bessel functions take most of the time
        radial = (scipy.special.jv(self.m[:, None], z * distances) * self._height[:, None])[:, place]
        found: Array = np.where(r <= 1, radial * self._turned(angle), 0.0)
        return found

    def inside(self, places: Array) -> bool:
        return bool((np.hypot(places[:, 0], places[:, 1]) < 1).all())

    def transform(self, wavenumbers: Array, angle: Array | float) -> Array:
        hankel = self._hankel(wavenumbers[:, None])[:, 0]
        found: Array = 2 * self._height * hankel * self._turned(np.asarray(angle)[None])[:, 0]
        return found

    def density(self, wavenumbers: Array) -> Array:
        height = 2 / self._slope[:, None] ** 2  # of the radial part alone
        found: Array = height * self.radius_m**2 * self._hankel(wavenumbers) ** 2 * wavenumbers
        return found

    @property
    def distinct(self) -> tuple[Numbers, Numbers]:
        _, first, place = np.unique(self.wavenumber, return_index=True, return_inverse=True)  # both of a pair
        return first, place

    def picked(self, index: Numbers) -> Circle:
        return Circle(self.radius_m, self.m[index], self.sine[index], self.wavenumber[index])

    @cached_property
    def _slope(self) -> Array:
        """J_m'(κa), which is -J_{m+1} at a zero of J_m."""
        slope: Array = -scipy.special.jv(self.m + 1, self.wavenumber * self.radius_m)
        return slope

    @property
    def _height(self) -> Array:
        """1/√(∫ J² cos² dA / A)."""
        height: Array = np.where(self.m == 0, 1.0, math.sqrt(2)) / np.abs(self._slope)
        return height

    def _turned(self, angle: Array) -> Array:
        turned: Array = np.where(self.sine[:, None], np.sin(self.m[:, None] * angle), np.cos(self.m[:, None] * angle))
        return turned

    def _hankel(self, wavenumbers: Array) -> Array:
        """∫ J_m(κr) J_m(sr) r dr / a², where J_m(κa) = 0; wavenumbers: s, (modes, n)."""
        z, s, m = self.wavenumber[:, None] * self.radius_m, wavenumbers * self.radius_m, self.m[:, None]
        slope, apart = self._slope[:, None], z**2 - s**2
        near = np.abs(z - s) < 1e-6 * z
        at_zero = slope**2 / 2 * (2 - s / z)  # to second order
        found: Array = np.where(near, at_zero, -z * slope * scipy.special.jv(m, s) / np.where(near, 1.0, apart))
        return found


@dataclass(frozen=True, eq=False)
class Rectangle:
    """2 sin(mπ(x+1)/2) sin(nπ(y+1)/2), κ² = (mπ/ℓ)² + (nπ/w)²; see `Surface`.

    n = 0: a bar, which moves alike across its width: √2 sin(mπ(x+1)/2).
    """

    length_m: float
    width_m: float
    m: Numbers
    n: Numbers
    wavenumber: Array

    @classmethod
    def below(cls, length_m: float, width_m: float, wavenumber: float) -> Rectangle:
        """All modes up to a wavenumber, by rising wavenumber."""
        most = [max(1, math.floor(wavenumber * side / math.pi)) for side in (length_m, width_m)]
        m, n = (part.ravel() for part in np.meshgrid(*(np.arange(1, count + 1) for count in most), indexing="ij"))
        kappa = np.hypot(m * math.pi / length_m, n * math.pi / width_m)
        order = np.argsort(kappa, kind="stable")
        order = order[kappa[order] <= wavenumber]
        return cls(length_m, width_m, m[order], n[order], kappa[order])

    @classmethod
    def bar_below(cls, length_m: float, width_m: float, wavenumber: float) -> Rectangle:
        """Those of a bar, whose long sides are free."""
        m = np.arange(1, math.floor(wavenumber * length_m / math.pi) + 1)
        return cls(length_m, width_m, m, np.zeros_like(m), np.asarray(m * (math.pi / length_m), np.float64))

    @property
    def area_m2(self) -> float:
        return self.length_m * self.width_m

    def shapes(self, places: Array) -> Array:
        x, y = ((1 + places[:, axis]) / 2 for axis in (0, 1))
        across = np.where(self.n[:, None] == 0, math.sqrt(0.5), np.sin(math.pi * self.n[:, None] * y))
        found: Array = np.where((np.abs(places) <= 1).all(1), 2 * np.sin(math.pi * self.m[:, None] * x) * across, 0.0)
        return found

    def inside(self, places: Array) -> bool:
        return bool((np.abs(places) < 1).all())

    def transform(self, wavenumbers: Array, angle: Array | float) -> Array:
        along, across = wavenumbers * np.cos(angle), wavenumbers * np.sin(angle)
        even = math.sqrt(0.5) * np.sinc(across * self.width_m / (2 * math.pi))
        of_width = np.where(self.n == 0, even, _of_sine(np.maximum(self.n, 1), across * self.width_m))
        found: Array = 2 * _of_sine(self.m, along * self.length_m) * of_width
        return found

    def density(self, wavenumbers: Array) -> Array:
        angles = (np.arange(16) + 0.5) * math.pi / 32  # a quarter turn: the squares are alike in all four
        squares = np.stack(
            [np.mean([self.transform(s, angle) ** 2 for angle in angles], axis=0) for s in wavenumbers.T], axis=1
        )
        found: Array = squares * self.area_m2 * wavenumbers / (2 * math.pi)
        return found

    @property
    def distinct(self) -> tuple[Numbers, Numbers]:
        every = np.arange(len(self.wavenumber))
        return every, every

    def picked(self, index: Numbers) -> Rectangle:
        return Rectangle(self.length_m, self.width_m, self.m[index], self.n[index], self.wavenumber[index])


def _of_sine(m: Numbers, turn: Array) -> Array:
    """|∫₀¹ sin(mπx) e^{i turn x} dx|, with the sign that the middle gives."""
    side, away = m * math.pi, np.abs(turn)
    sign = np.where(m % 2 == 1, 1.0, np.sign(turn)) * np.where((m - 1) % 4 < 2, 1.0, -1.0)
    found: Array = sign * side / (side + away) * np.sinc((away - side) / (2 * math.pi))
    return found


def spread(wavenumber: Array, radius_m: float) -> Array:
    """The mean of a mode over a disc, of its value at the centre: 2 J₁(κR)/κR, as for any solution of -∇²φ = κ²φ."""
    turn = wavenumber * radius_m
    small = turn < 1e-6
    found: Array = np.where(small, 1.0, 2 * scipy.special.j1(turn) / np.where(small, 1.0, turn))
    return found
