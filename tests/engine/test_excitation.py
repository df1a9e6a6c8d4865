"""Plucks and the paper's random initial displacements."""

import math

import pytest
import torch

from engine import excitation
from engine.excitation import rounded, triangular
from engine.pluck import SHAPES, Pluck


@pytest.mark.parametrize("shape", SHAPES)
def test_a_pluck_peaks_where_and_as_far_as_asked(shape: str) -> None:
    displacement = Pluck(position=0.3, amplitude_mm=2.5, shape=shape, width=0.1).displacement(101)  # type: ignore[arg-type]
    assert abs(int(displacement.argmax()) - 30) <= (2 if shape == "rounded" else 0)  # it is round where it is pulled
    assert float(displacement.max()) == pytest.approx(2.5e-3)
    assert displacement[[0, -1]].eq(0).all()


@pytest.mark.parametrize(
    ("field", "value"),
    [("position", 0.0), ("position", 1.2), ("amplitude_mm", -1), ("amplitude_mm", 99), ("width", 0)],
)
def test_a_pluck_out_of_range_names_the_field_and_the_range(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"{field.removesuffix('_mm')} must lie in .* not"):
        Pluck(**{field: value})


@pytest.mark.parametrize("kind", ["gaussian", "noise"])
def test_draws_follow_the_protocol(kind: str) -> None:
    draws = excitation.DRAWS[kind](500, 101, torch.Generator().manual_seed(3))
    peaks = draws.amax(1)
    assert draws.shape == (500, 101)
    assert draws[:, [0, -1]].eq(0).all()
    assert draws.min() >= 0
    # a narrow Gaussian between two grid points peaks a little below its parameter
    assert peaks.min() >= 0.9 * excitation.PEAK_RANGE_M[0]
    assert peaks.max() <= excitation.PEAK_RANGE_M[1]
    assert float(peaks.mean()) == pytest.approx(5.5e-3, rel=0.1)
    again = excitation.DRAWS[kind](500, 101, torch.Generator().manual_seed(3))
    assert torch.equal(draws, again)


def test_gaussians_lie_where_the_protocol_says() -> None:
    draws = excitation.draw_gaussians(500, 101, torch.Generator().manual_seed(0))
    centres = draws.argmax(1) / 100
    assert 0.29 <= float(centres.min()) <= 0.33
    assert 0.67 <= float(centres.max()) <= 0.71


def test_random_plucks_are_a_musicians() -> None:
    draws = excitation.draw_plucks(600, 401, torch.Generator().manual_seed(0))
    peaks = draws.amax(1)
    assert draws.shape == (600, 401) and draws[:, [0, -1]].eq(0).all() and draws.min() >= 0
    assert 0.9 * excitation.PLUCK_PEAK_RANGE_M[0] <= peaks.min() and peaks.max() <= excitation.PLUCK_PEAK_RANGE_M[1]
    assert float(peaks.log().mean()) == pytest.approx(0.5 * math.log(5e-4 * 1e-2), abs=0.1)
    places = draws.argmax(1) / 400
    assert float(places.min()) < 0.08 and float(places.max()) > 0.92
    # a triangle has two slopes and nothing else; a raised cosine is zero away from its place
    bends = (draws[1::3].diff(n=2).abs() > 1e-9 * peaks[1::3, None]).sum(1)
    assert int(bends.max()) <= 2
    assert (draws[2::3] == 0).double().mean(1).min() > 0.6
    assert torch.equal(draws, excitation.draw_plucks(600, 401, torch.Generator().manual_seed(0)))


def test_a_rounded_triangle_is_the_triangle_under_a_spread_force() -> None:
    """The string's second derivative is the force: a raised cosine of that width, and none outside it."""
    points, position, width = 401, 0.3, 0.2
    shape = rounded(position, width, 2e-3, points)
    assert float(shape.max()) == pytest.approx(2e-3)
    force = -torch.diff(shape, 2) * (points - 1) ** 2
    x = torch.linspace(0, 1, points, dtype=torch.float64)[1:-1]
    wanted = torch.where((x - position).abs() < width / 2, 1 + torch.cos(2 * torch.pi * (x - position) / width), 0.0)
    torch.testing.assert_close(force / force.max(), wanted / 2, atol=2e-3, rtol=0)


def test_a_narrow_one_is_the_triangle() -> None:
    narrow, sharp = rounded(0.3, 1e-6, 2e-3, 101), triangular(0.3, 2e-3, 101)
    torch.testing.assert_close(narrow, sharp, atol=2e-5, rtol=0)  # but for modes beyond the grid
