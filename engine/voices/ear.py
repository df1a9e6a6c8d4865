"""The listening to a string: the points, and the pick-up."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from engine.kernels.voice_records import BRIGHTER
from engine.levels import FULL_SCALE_M, FULL_SCALE_M_S, FULL_SCALE_N, LEAST_PEAK_M
from engine.resonators.base import Array
from engine.resonators.sine_transform import analysis_matrix, listening_weights, synthesis_matrix

PickupKind = Literal["displacement", "velocity", "bridge"]
FULL_SCALES = {"displacement": FULL_SCALE_M, "velocity": FULL_SCALE_M_S, "bridge": FULL_SCALE_N}


@dataclass(frozen=True)
class Ear:
    """A pair of listening points with a pick-up.

    Attributes:
        points: one listening point, or two for left and right, 0 … 1 in lengths of the string.
        pickup: "velocity" is what a magnetic pick-up senses, brighter by 6 dB an octave. "bridge" is the force on the
            end at 0, which drives an instrument's body; it is the same whatever the points are.
        solo: above 0, this mode alone is heard.
    """

    points: tuple[float, ...]
    pickup: PickupKind = "displacement"
    solo: int = 0

    @property
    def full_scale(self) -> float:
        """The value of 0 dBFS, in m, m/s or N."""
        return FULL_SCALES[self.pickup]

    def weights(self, grid_points: int, force: Array | None = None) -> Array:
        """float64 (grid_points, points): displacement @ weights is the signal; 0 for a mode beyond the grid.

        It is in m, of which the velocity is taken later; at the bridge, in N times the ratio of the full scales.

        Args:
            force: `Resonator.force_weights` of the string, for the bridge.

        Raises:
            ValueError: it has no bridge.
        """
        if self.pickup != "bridge":
            return _weights(self.points, self.solo, grid_points)
        if force is None:
            raise ValueError("it has no end whose force can be heard; choose another pick-up")
        if self.solo > grid_points - 2:
            force = np.zeros_like(force)
        elif self.solo > 0:
            shape = synthesis_matrix(grid_points, self.solo)[-1]
            force = analysis_matrix(grid_points, self.solo)[:, -1] * (shape @ force)
        return (force * (FULL_SCALE_M / FULL_SCALE_N))[:, None].repeat(len(self.points), axis=1)

    def largest(self, displacement_m: Array, force: Array | None = None) -> float:
        """A bound of the signal after a release from this shape, in the unit of `weights`; narrow plucks pass it.

        A velocity is bounded by ten times the displacement of full scale. The force at an end never passes tension
        times the steepest slope: waves to both sides have half of it each, and the end doubles it.
        """
        peak = max(float(np.abs(displacement_m).max()), LEAST_PEAK_M)
        if self.pickup != "bridge" or force is None:
            return peak * (BRIGHTER if self.pickup == "velocity" else 1.0)
        place = np.linspace(0, 1, len(force))
        tension = float((place * (1 - place)) @ force)  # per length: the slope of this curve is 1 at the end
        steepest = float(np.abs(np.diff(displacement_m)).max()) * (len(force) - 1)
        return max(peak, tension * steepest * (FULL_SCALE_M / FULL_SCALE_N))

    def is_on_node(self, point: float) -> bool:
        """Return True if nothing can be heard there: a fixed end, or a node of the only mode heard."""
        if self.pickup == "bridge":
            return False
        return point in (0.0, 1.0) or (self.solo > 0 and abs(math.sin(math.pi * self.solo * point)) < 1e-3)


@lru_cache(maxsize=16)  # asked for with every block
def _weights(listening_points: tuple[float, ...], solo: int, grid_points: int) -> Array:
    points = np.array(listening_points)
    if solo == 0:
        return listening_weights(points, grid_points)
    if solo > grid_points - 2:
        return np.zeros((grid_points, len(points)))
    mode = analysis_matrix(grid_points, solo)[:, -1:]
    return mode * np.sin(math.pi * solo * points)
