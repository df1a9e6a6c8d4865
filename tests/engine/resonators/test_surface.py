"""Modes of circle and rectangle: norms, transforms and edges, by sums over a fine grid."""

import numpy as np
import pytest

from engine.resonators.surface import Circle, Rectangle, Surface, spread

SIDE = 301
GRID = np.stack(np.meshgrid(*(np.linspace(-1, 1, SIDE),) * 2), axis=-1).reshape(-1, 2)
CIRCLE, RECTANGLE = Circle.below(0.2, 60.0), Rectangle.below(0.4, 0.3, 60.0)


def cells(surface: Surface) -> np.ndarray:
    """The places of GRID on a surface."""
    return GRID[np.hypot(*GRID.T) <= 1] if isinstance(surface, Circle) else GRID


def metres(surface: Surface) -> np.ndarray:
    return np.array([0.2, 0.2] if isinstance(surface, Circle) else [0.2, 0.15])


@pytest.mark.parametrize("surface", [CIRCLE, RECTANGLE])
def test_shapes_are_orthonormal(surface: Surface) -> None:
    shapes = surface.shapes(cells(surface))
    gram = shapes @ shapes.T / len(cells(surface))
    assert np.abs(gram - np.eye(len(gram))).max() < 0.02


@pytest.mark.parametrize("surface", [CIRCLE, RECTANGLE])
def test_transform_is_the_integral(surface: Surface) -> None:
    s, angle = np.full(len(surface.wavenumber), 9.0), 0.4
    phase = 9.0 * (cells(surface) * metres(surface)) @ np.array([np.cos(angle), np.sin(angle)])
    expected = np.abs((surface.shapes(cells(surface)) * np.exp(1j * phase)).mean(1))
    assert np.allclose(np.abs(surface.transform(s, angle)), expected, atol=0.01)


@pytest.mark.parametrize("surface", [CIRCLE.picked(np.arange(4)), RECTANGLE.picked(np.arange(4))])
def test_density_holds_all_of_a_mode(surface: Surface) -> None:
    s = np.linspace(0.05, 600, 6000)
    assert np.allclose(surface.density(np.tile(s, (4, 1))).sum(1) * (s[1] - s[0]), 1, atol=2e-3)


def test_frequencies_of_the_circle_are_zeros_of_bessel_functions() -> None:
    assert np.allclose(CIRCLE.wavenumber[:6] * 0.2, [2.404826, 3.831706, 3.831706, 5.135622, 5.135622, 5.520078])
    assert list(CIRCLE.m[:6]) == [0, 1, 1, 2, 2, 0]


def test_the_mean_over_a_disc() -> None:
    place, radius = np.array([0.3, -0.2]), 0.02
    disc = GRID[np.hypot(*GRID.T) <= 1] * (radius / metres(CIRCLE)) + place
    expected = CIRCLE.shapes(disc).mean(1)
    found = CIRCLE.shapes(place[None])[:, 0] * spread(CIRCLE.wavenumber, radius)
    assert np.allclose(found, expected, atol=2e-3)


def test_the_edge_rests() -> None:
    angle = np.linspace(0, 6, 20)
    assert np.abs(CIRCLE.shapes(np.stack([np.cos(angle), np.sin(angle)], axis=1))).max() < 1e-9
