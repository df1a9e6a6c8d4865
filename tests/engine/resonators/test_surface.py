"""Modes of circle and rectangle: norms, transforms and edges over a fine grid; Bessel functions are SciPy's."""

import numpy as np
import pytest
import scipy

from engine.kernels import drum_modes as kernel
from engine.resonators.base import Array
from engine.resonators.surface import Surface, modes_below, tools
from engine.values.drum import SHAPES

SIDE = 251
GRID = np.stack(np.meshgrid(*(np.linspace(-1, 1, SIDE),) * 2), axis=-1).reshape(-1, 2)


def surface_of(shape: str, length_m: float, width_m: float) -> Surface:
    sides = np.array([SHAPES.index(shape), length_m, width_m])
    return Surface(sides, modes_below(shape, length_m / width_m, 60.0 * kernel.size(sides)))


CIRCLE, RECTANGLE = surface_of("circle", 0.4, 0.4), surface_of("rectangle", 0.4, 0.3)


def cells(surface: Surface) -> np.ndarray:
    """The places of GRID on a surface."""
    return GRID[np.hypot(*GRID.T) <= 1] if surface.round else GRID


def metres(surface: Surface) -> np.ndarray:
    return np.array([0.2, 0.2] if surface.round else [0.2, 0.15])


@pytest.mark.parametrize("surface", [CIRCLE, RECTANGLE], ids=["circle", "rectangle"])
def test_shapes_are_orthonormal_and_their_transforms_are_the_integrals(surface: Surface) -> None:
    places, angle = cells(surface), 0.4
    shapes = surface.shapes(places)
    gram = shapes @ shapes.T / len(places)
    assert np.abs(gram - np.eye(len(gram))).max() < 0.02
    along, across = 9.0 * np.cos(angle), 9.0 * np.sin(angle)
    phase = (places * metres(surface)) @ np.array([along, across])
    found = [
        kernel.transform(surface.sides, surface.rows, mode, along, across, tools()) for mode in range(len(surface.m))
    ]
    np.testing.assert_allclose(np.abs(found), np.abs((shapes * np.exp(1j * phase)).mean(1)), atol=0.01)
    lowest, s = surface.picked(np.arange(4)), np.linspace(0.01, 120, 6000)
    whole, out = np.zeros(4), np.empty(4)
    for each in s:  # a mode's density holds all of it
        kernel.densities(lowest.sides, lowest.rows, float(each), out, np.empty(kernel.ORDERS))
        whole += out * (s[1] - s[0])
    np.testing.assert_allclose(whole, 1, atol=2e-3)


def test_the_mean_over_a_disc() -> None:
    place, radius = np.array([0.3, -0.2]), 0.02
    disc = GRID[np.hypot(*GRID.T) <= 1] * (radius / metres(CIRCLE)) + place
    expected = CIRCLE.shapes(disc).mean(1)
    spread = [kernel.spread(each * radius, tools()) for each in CIRCLE.wavenumber]
    found = CIRCLE.shapes(place[None])[:, 0] * spread
    assert np.allclose(found, expected, atol=2e-3)


def test_bessel_functions_and_their_table_are_scipys() -> None:
    for x in (0.0, 1e-5, 2e-4, 0.3, 5.0, 77.7, 280.0):
        all_orders = np.empty(300)
        assert kernel.bessels(x, all_orders) == pytest.approx(scipy.special.struve(1, x), abs=1e-14)
        np.testing.assert_allclose(all_orders, scipy.special.jv(np.arange(300), x), atol=2e-14)
    table = np.zeros((300, 100 + 2 * kernel.TERMS))
    kernel.tabulate(table)
    orders, places = np.arange(0, 120, 3), np.linspace(0, 29.9, 1234)
    found = [[kernel.bessel(int(m), float(x), (table, np.empty(kernel.ORDERS))) for m in orders] for x in places]
    np.testing.assert_allclose(found, scipy.special.jv(orders, places[:, None]), atol=5e-11)


def test_zeros_are_scipys() -> None:
    rows = modes_below("circle", 1.0, 60.0)
    expected = [z for m in range(60) for z in scipy.special.jn_zeros(m, 20) for _ in range(2 if m else 1) if z <= 60]
    np.testing.assert_allclose(rows[kernel.Z], sorted(expected), rtol=1e-12)
    np.testing.assert_allclose(rows[kernel.SLOPE], scipy.special.jvp(rows[kernel.M], rows[kernel.Z]), atol=1e-13)


def test_the_air_at_a_circle_is_the_integral_with_scipys_functions() -> None:
    low, ka, points = np.ascontiguousarray(modes_below("circle", 1.0, 16.0)[:, ::7]), 3.3, 4096
    found: Array = np.empty((2, low.shape[1]))
    kernel.air_at(np.array([0.0, 2.0, 2.0]), low, ka, 256, found, np.empty(low.shape[1] + kernel.ORDERS))
    z, m = (row[:, None] for row in low[:2])

    def shares(s: Array) -> Array:
        return 2 * s * (z * scipy.special.jv(m, s) / (z * z - s * s)) ** 2

    u, alpha = ((np.arange(points) + 0.5) / points * most for most in (128.0, np.pi / 2))
    s = np.hypot(ka, u)
    np.testing.assert_allclose(found[0], (shares(s) / s).sum(1) * u[0] * 2, rtol=3e-5)
    np.testing.assert_allclose(found[1], shares(ka * np.sin(alpha)).sum(1) * alpha[0] * 2 / ka, rtol=2e-4)
