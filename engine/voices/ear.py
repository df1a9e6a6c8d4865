"""Where and how a string is heard."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import torch
from torch import Tensor

from engine.pluck import FULL_SCALE_M, FULL_SCALE_M_S
from engine.resonators.sine_transform import analysis_matrix, listening_weights


@dataclass(frozen=True)
class Ear:
    """A pair of listening points with a pick-up.

    Attributes:
        points: one listening point, or two for left and right, 0 … 1 in lengths of the string.
        pickup: "velocity" is what a magnetic pick-up senses, brighter by 6 dB an octave.
        solo: above 0, this mode alone is heard.
    """

    points: tuple[float, ...]
    pickup: Literal["displacement", "velocity"] = "displacement"
    solo: int = 0

    @property
    def full_scale(self) -> float:
        """What is 0 dBFS, in m or m/s."""
        return FULL_SCALE_M if self.pickup == "displacement" else FULL_SCALE_M_S

    def weights(self, grid_points: int) -> Tensor:
        """float64 (grid_points, points): displacement @ weights is the signal; 0 for a mode beyond the grid."""
        return _weights(self.points, self.solo, grid_points)

    def is_on_node(self, point: float) -> bool:
        """Whether nothing can be heard there: a fixed end, or a node of the mode that is heard alone."""
        return point in (0.0, 1.0) or (self.solo > 0 and abs(math.sin(math.pi * self.solo * point)) < 1e-3)


@lru_cache(maxsize=16)  # asked for with every block
def _weights(listening_points: tuple[float, ...], solo: int, grid_points: int) -> Tensor:
    points = torch.tensor(listening_points, dtype=torch.float64)
    if solo == 0:
        return listening_weights(points, grid_points)
    if solo > grid_points - 2:
        return torch.zeros(grid_points, len(points), dtype=torch.float64)
    mode = analysis_matrix(grid_points, solo)[:, -1:]
    return mode * torch.sin(math.pi * solo * points)[None]
