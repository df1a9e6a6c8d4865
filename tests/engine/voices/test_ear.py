"""Listening points and solo: what is read off a motion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import torch

from engine.excitation import displacement
from engine.levels import FULL_SCALE_M, FULL_SCALE_M_S, FULL_SCALE_N, RUNAWAY_FACTOR
from engine.pluck import Pluck
from engine.resonators.base import Array
from engine.resonators.sine_transform import to_grid
from engine.resonators.string import resonator_of
from engine.truth import ModalState
from engine.values.ear import Ear
from engine.values.string import StringParameters
from engine.voices.ear import REACH_FRAMES, largest, weights_of
from tests.engine.tensors import solve_linear

POINTS = 101


def test_solo_reads_one_mode_at_the_listening_point() -> None:
    amplitudes = np.random.default_rng(0).normal(size=25)
    motion = to_grid(amplitudes, POINTS)
    for mode in (1, 7, 25):
        heard = motion @ weights_of(Ear((0.37,), solo=mode), POINTS)[:, 0]
        assert float(heard) == pytest.approx(float(amplitudes[mode - 1]) * np.sin(np.pi * mode * 0.37), abs=1e-12)
    everything = sum(motion @ weights_of(Ear((0.37,), solo=mode), POINTS)[:, 0] for mode in range(1, POINTS - 1))
    assert float(everything) == pytest.approx(float(motion @ weights_of(Ear((0.37,)), POINTS)[:, 0]), abs=1e-12)
    assert not weights_of(Ear((0.37,), solo=POINTS), POINTS).any()


STIFF = StringParameters(0.65, 5e-7, 2e-14, 7850.0, 2e11, 4e-4, 4e-7, 75.0)
BRIDGE = Ear((0.37, 0.61), "bridge")


def newtons(displacement_m: Array, ear: Ear = BRIDGE, modes: int = POINTS - 2) -> Array:
    force = resonator_of(STIFF, modes, grid_points=POINTS).force_weights
    return displacement_m @ weights_of(ear, POINTS, force) * (FULL_SCALE_N / FULL_SCALE_M)


def test_the_force_of_a_mode_is_that_of_tension_and_stiffness_at_the_end() -> None:
    """T ∂y/∂x - EI ∂³y/∂x³ at x = 0, by finite differences of one mode."""
    mode, step = 7, 1e-4 * STIFF.length_m
    x = step * np.arange(5)
    y = 1e-3 * np.sin(mode * np.pi * x / STIFF.length_m)
    slope = float(-25 * y[0] + 48 * y[1] - 36 * y[2] + 16 * y[3] - 3 * y[4]) / (12 * step)
    third = float(-5 * y[0] + 18 * y[1] - 24 * y[2] + 14 * y[3] - 3 * y[4]) / (2 * step**3)
    bending = STIFF.youngs_modulus_pa * STIFF.second_moment_m4
    amplitudes = np.zeros(20)
    amplitudes[mode - 1] = 1e-3
    heard = newtons(to_grid(amplitudes, POINTS))
    expected = STIFF.tension_n * slope - bending * third
    assert heard.tolist() == pytest.approx([expected, expected], rel=1e-4)
    for solo, alone in ((mode, expected), (mode + 1, 0.0), (POINTS, 0.0)):
        found = newtons(to_grid(amplitudes, POINTS), Ear((0.5,), "bridge", solo))
        assert float(found[0]) == pytest.approx(alone, rel=1e-4, abs=1e-9)


def test_the_bridge_bears_the_tension_times_the_slope_of_a_pull() -> None:
    flexible = StringParameters(0.65, 5e-7, 0.0, 7850.0, 2e11, 4e-4, 4e-7, 75.0)
    force = resonator_of(flexible, POINTS - 2, grid_points=POINTS).force_weights
    pulled = Pluck(0.4, 3.0, "raised_cosine", 0.4).displacement(POINTS)  # it lies flat at the bridge
    wide = displacement("triangular", 0.5, 1.0, 3e-3, POINTS)
    weights = weights_of(BRIDGE, POINTS, force)[:, 0] * (FULL_SCALE_N / FULL_SCALE_M)
    assert float(wide @ weights) == pytest.approx(75.0 * 3e-3 / (0.5 * 0.65), rel=0.02)
    assert abs(float(pulled @ weights)) < 0.02


@pytest.mark.parametrize("pluck", [Pluck(0.1, 3.0, "triangular"), Pluck(0.5, 3.0, width=0.03), Pluck(0.03, 3.0)])
def test_no_motion_passes_the_bound_by_much(pluck: Pluck) -> None:
    resonator = resonator_of(STIFF, 60, grid_points=POINTS, tension_modulated=False)
    shape = resonator.to_grid(resonator.to_modes(pluck.displacement(POINTS)))
    times = torch.arange(2000, dtype=torch.float64) / 48_000
    assert resonator.end_force is not None
    moved = solve_linear(resonator, ModalState.at_rest(torch.from_numpy(resonator.to_modes(shape)[None])), times)
    heard = moved[0].numpy() @ resonator.end_force
    bound = largest(BRIDGE, shape, resonator.force_weights) * (FULL_SCALE_N / FULL_SCALE_M)
    assert 0.2 * bound < float(np.abs(heard).max()) < 0.2 * RUNAWAY_FACTOR * bound


def test_nodes_are_known_and_a_bridge_is_no_place_on_the_string() -> None:
    assert Ear((0.5,), solo=2).is_on_node(0.5) and Ear((0.0,)).is_on_node(0.0)
    assert not any(
        ear.is_on_node(place)
        for ear, place in ((Ear((0.5,), solo=3), 0.5), (Ear((0.5,)), 0.5), (Ear((0.0,), "bridge"), 0.0))
    )
    pickups = ("displacement", "velocity", "bridge")
    assert [Ear((0.5,), each).full_scale for each in pickups] == [FULL_SCALE_M, FULL_SCALE_M_S, FULL_SCALE_N]
    with pytest.raises(ValueError, match="another pick-up"):
        weights_of(BRIDGE, POINTS)


@pytest.mark.parametrize("rate_hz", [4_000, 48_000])
def test_velocity_is_the_derivative(rate_hz: int, derivative: Callable[..., np.ndarray]) -> None:
    time_s = np.arange(4000) / rate_hz
    omega = 2 * np.pi * rate_hz * np.array([[0.01, 0.13, 0.31, 0.42]])
    signal = np.cos(omega * time_s[:, np.newaxis])
    exact = -omega * np.sin(omega * time_s[:, np.newaxis])
    inner = slice(0, len(signal) - 2 * REACH_FRAMES)  # the beginning, at rest, is exact as well
    assert (np.abs(derivative(signal, rate_hz) - exact)[inner].max(axis=0) / omega[0]).max() < 6e-4
