"""The signal that an ear makes of a string's displacement, and the filter that makes velocity of it."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from engine.kernels.mixer_records import REACH as REACH_FRAMES
from engine.kernels.voice_records import BRIGHTER
from engine.levels import FULL_SCALE_M, FULL_SCALE_N, LEAST_PEAK_M
from engine.resonators.base import Array
from engine.resonators.sine_transform import analysis_matrix, listening_weights, synthesis_matrix
from engine.values.ear import Ear

KAISER_BETA = 8.0  # shape of the differentiator's window


def weights_of(ear: Ear, grid_points: int, force: Array | None = None) -> Array:
    """float64 (grid_points, points): displacement @ weights is the signal; 0 for a mode beyond the grid.

    It is in m, of which the velocity is taken later; at the bridge, in N times the ratio of the full scales.

    Args:
        force: `Resonator.force_weights` of the string, for the bridge.

    Raises:
        ValueError: it has no bridge.
    """
    if ear.pickup != "bridge":
        return _weights(ear.points, ear.solo, grid_points)
    if force is None:
        raise ValueError("it has no end whose force can be heard; choose another pick-up")
    if ear.solo > grid_points - 2:
        force = np.zeros_like(force)
    elif ear.solo > 0:
        shape = synthesis_matrix(grid_points, ear.solo)[-1]
        force = analysis_matrix(grid_points, ear.solo)[:, -1] * (shape @ force)
    return (force * (FULL_SCALE_M / FULL_SCALE_N))[:, None].repeat(len(ear.points), axis=1)


def largest(ear: Ear, displacement_m: Array, force: Array | None = None) -> float:
    """A bound of the signal after a release from this shape, in the unit of `weights_of`; narrow plucks pass it.

    A velocity is bounded by ten times the displacement of full scale. The force at an end never passes tension
    times the steepest slope: waves to both sides have half of it each, and the end doubles it.
    """
    peak = max(float(np.abs(displacement_m).max()), LEAST_PEAK_M)
    if ear.pickup != "bridge" or force is None:
        return peak * (BRIGHTER if ear.pickup == "velocity" else 1.0)
    place = np.linspace(0, 1, len(force))
    tension = float((place * (1 - place)) @ force)  # per length: the slope of this curve is 1 at the end
    steepest = float(np.abs(np.diff(displacement_m)).max()) * (len(force) - 1)
    return max(peak, tension * steepest * (FULL_SCALE_M / FULL_SCALE_N))


@lru_cache(maxsize=16)  # asked for with every block
def _weights(listening_points: tuple[float, ...], solo: int, grid_points: int) -> Array:
    """Weights (grid_points, points) of the displacement at the points; above 0, mode `solo` alone is heard."""
    points = np.array(listening_points)
    if solo == 0:
        return listening_weights(points, grid_points)
    if solo > grid_points - 2:
        return np.zeros((grid_points, len(points)))
    mode = analysis_matrix(grid_points, solo)[:, -1:]
    return mode * np.sin(math.pi * solo * points)


def differentiator_taps(rate_hz: int) -> Array:
    """Taps of the derivative of a band-limited signal, per second: a Kaiser-windowed ideal differentiator.

    Its phase is exact, for the taps are odd about the middle; its gain is true within 0.12 % up to 0.9 of half the
    rate. They are `2 * REACH_FRAMES + 1`, the one for the earliest sample first.
    """
    distance = np.arange(1, REACH_FRAMES + 1)
    window = np.kaiser(2 * REACH_FRAMES + 1, KAISER_BETA)[REACH_FRAMES + 1 :]
    half = rate_hz * np.where(distance % 2, 1.0, -1.0) / distance * window
    return np.concatenate([-half[::-1], [0.0], half])
