"""Plucks and blows: their shapes, and what a release or a contact of some time leaves."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from engine.excitation import blow_factor, displacement
from engine.kernels.pulses import spectrum
from engine.pluck import SHAPES, Pluck
from engine.resonators.sine_transform import to_grid, to_modes


@pytest.mark.parametrize("shape", SHAPES)
def test_a_pluck_peaks_where_and_as_far_as_asked(shape: str) -> None:
    displacement = Pluck(position=0.3, amplitude_mm=2.5, shape=shape, width=0.1).displacement(101)
    assert abs(int(displacement.argmax()) - 30) <= (2 if shape == "rounded" else 0)  # it is round where it is pulled
    assert float(displacement.max()) == pytest.approx(2.5e-3)
    assert (displacement[[0, -1]] == 0).all()


def test_a_rounded_triangle_is_the_triangle_under_a_spread_force() -> None:
    """The string's second derivative is the force: a raised cosine of that width, and none outside it."""
    points, position, width = 401, 0.3, 0.2
    shape = displacement("rounded", position, width, 2e-3, points)
    assert float(shape.max()) == pytest.approx(2e-3)
    force = -np.diff(shape, 2) * (points - 1) ** 2
    x = np.linspace(0, 1, points)[1:-1]
    wanted = np.where(np.abs(x - position) < width / 2, 1 + np.cos(2 * np.pi * (x - position) / width), 0.0)
    np.testing.assert_allclose(force / force.max(), wanted / 2, atol=2e-3, rtol=0)
    narrow, sharp = displacement("rounded", 0.3, 1e-6, 2e-3, 101), displacement("triangular", 0.3, 1.0, 2e-3, 101)
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
    left = spectrum(omega * release_s / (2 * np.pi))
    np.testing.assert_allclose(found.y[:4, -1], left * np.cos(omega * (end_s - release_s / 2)), atol=1e-8)


@pytest.mark.parametrize("contact_s", [0.5e-3, 2e-3, 4e-3])
def test_a_blow_is_the_force_of_a_hammer_for_a_time(contact_s: float) -> None:
    """Against DOP853 of a linear string's modes under that force, from rest: amplitude and speed after it."""
    partial = np.arange(1, 7)
    omega = 220 * np.pi * partial * np.sqrt(1 + 1e-3 * partial**2)
    shape_m = displacement("raised_cosine", 0.2, 0.1, 1e-3, 401)
    swings = to_modes(shape_m, 6) * blow_factor(omega, shape_m / 1e-3)
    unit = omega * swings  # the speeds that a blow in no time gives

    def right_side(t: float, y: np.ndarray) -> np.ndarray:
        force = (1 - np.cos(2 * np.pi * t / contact_s)) / contact_s if t < contact_s else 0.0
        return np.concatenate([y[6:], unit * force - omega**2 * y[:6]])

    most = {"rtol": 1e-11, "atol": 1e-15, "max_step": contact_s / 50}
    end_s = contact_s + 0.003
    found = solve_ivp(right_side, (0, end_s), np.zeros(12), "DOP853", **most).y[:, -1]
    after_s, left = end_s - contact_s / 2, spectrum(omega * contact_s / (2 * np.pi))
    np.testing.assert_allclose(found[:6], left * swings * np.sin(omega * after_s), atol=1e-10)
    np.testing.assert_allclose(found[6:], left * unit * np.cos(omega * after_s), atol=1e-6)


def test_a_blow_sends_out_a_wave_as_high_as_the_pluck_is() -> None:
    """On a flexible string, before it has come to an end."""
    points = 801
    shape_m = displacement("raised_cosine", 0.4, 0.06, 1e-3, points)
    omega = 2 * np.pi * 100.0 * np.arange(1, points - 1)
    swings = to_modes(shape_m, points - 2) * blow_factor(omega, shape_m / 1e-3)
    wave_m = to_grid(swings * np.sin(omega * 1e-3), points)  # after a tenth of a period it has run 0.2 to both sides
    x = np.linspace(0, 1, points)
    np.testing.assert_allclose(wave_m[(x > 0.26) & (x < 0.54)], 1e-3, rtol=5e-3)
    assert np.abs(wave_m[(x < 0.15) | (x > 0.65)]).max() < 1e-5
