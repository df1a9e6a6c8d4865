"""Plucks."""

import numpy as np
import pytest

from engine.excitation import rounded, triangular
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
