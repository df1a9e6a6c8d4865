"""Plucks."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from engine.excitation import release_factor, rounded, triangular
from engine.pluck import SHAPES, Pluck


@pytest.mark.parametrize("shape", SHAPES)
def test_a_pluck_peaks_where_and_as_far_as_asked(shape: str) -> None:
    displacement = Pluck(position=0.3, amplitude_mm=2.5, shape=shape, width=0.1).displacement(101)  # type: ignore[arg-type]
    assert abs(int(displacement.argmax()) - 30) <= (2 if shape == "rounded" else 0)  # it is round where it is pulled
    assert float(displacement.max()) == pytest.approx(2.5e-3)
    assert (displacement[[0, -1]] == 0).all()


@pytest.mark.parametrize(
    ("field", "value"),
    [("position", 0.0), ("position", 1.2), ("amplitude_mm", -1), ("amplitude_mm", 99), ("width", 0)],
)
def test_a_pluck_out_of_range_names_the_field_and_the_range(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"{field.removesuffix('_mm')} must lie in .* not"):
        Pluck(**{field: value})


def test_a_rounded_triangle_is_the_triangle_under_a_spread_force() -> None:
    """The string's second derivative is the force: a raised cosine of that width, and none outside it."""
    points, position, width = 401, 0.3, 0.2
    shape = rounded(position, width, 2e-3, points)
    assert float(shape.max()) == pytest.approx(2e-3)
    force = -np.diff(shape, 2) * (points - 1) ** 2
    x = np.linspace(0, 1, points)[1:-1]
    wanted = np.where(np.abs(x - position) < width / 2, 1 + np.cos(2 * np.pi * (x - position) / width), 0.0)
    np.testing.assert_allclose(force / force.max(), wanted / 2, atol=2e-3, rtol=0)


def test_a_narrow_one_is_the_triangle() -> None:
    narrow, sharp = rounded(0.3, 1e-6, 2e-3, 101), triangular(0.3, 2e-3, 101)
    np.testing.assert_allclose(narrow, sharp, atol=2e-5, rtol=0)  # except modes beyond the grid


@pytest.mark.parametrize("release_s", [0.5e-3, 2e-3, 6e-3])
def test_a_release_in_a_time_is_one_at_once_from_a_smaller_displacement(release_s: float) -> None:
    """Against DOP853 of modes whose force falls as a raised cosine, without losses: from the middle of the fall."""
    omega = 2 * np.pi * np.array([110.0, 333.0, 1000.0, 2500.0])

    def right_side(t: float, y: np.ndarray) -> np.ndarray:
        share = min(max(t / release_s, 0.0), 1.0)
        force = 1 - share + np.sin(2 * np.pi * share) / (2 * np.pi)
        return np.concatenate([y[4:], omega**2 * (force - y[:4])])

    end_s = release_s + 0.01
    start = np.concatenate([np.ones(4), np.zeros(4)])
    most = {"rtol": 1e-11, "atol": 1e-13, "max_step": release_s / 50}
    found = solve_ivp(right_side, (0, end_s), start, "DOP853", **most)
    left = release_factor(omega, release_s)
    np.testing.assert_allclose(found.y[:4, -1], left * np.cos(omega * (end_s - release_s / 2)), atol=1e-8)
