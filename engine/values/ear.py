"""The listening to a string: the points, and the pick-up."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from engine import bounds
from engine.levels import FULL_SCALE_M, FULL_SCALE_M_S, FULL_SCALE_N

Pickup = Literal["displacement", "velocity", "bridge"]
PICKUPS: tuple[Pickup, ...] = get_args(Pickup)
FULL_SCALES: dict[Pickup, float] = {"displacement": FULL_SCALE_M, "velocity": FULL_SCALE_M_S, "bridge": FULL_SCALE_N}


@dataclass(frozen=True)
class Ear:
    """A pair of listening points with a pick-up.

    Attributes:
        points: one listening point, or two for left and right, 0 … 1 in lengths of the string.
        pickup: "velocity" is what a magnetic pick-up senses, brighter by 6 dB an octave. "bridge" is the force on the
            end at 0, which drives an instrument's body; it is the same whatever the points are.
        solo: above 0, this mode alone is heard.

    Raises:
        ValueError: a value is out of its range; the message names it and the range.
    """

    points: tuple[float, ...]
    pickup: Pickup = "displacement"
    solo: int = 0

    def __post_init__(self) -> None:
        if len(self.points) not in (1, 2):
            raise ValueError(f"listening points must be one or two, not {len(self.points)}")
        for name, point in zip(("listening point", "right listening point"), self.points, strict=False):
            bounds.check(name, point, (0, 1))
        bounds.check_choice("pickup", self.pickup, PICKUPS)

    @property
    def full_scale(self) -> float:
        """The value of 0 dBFS, in m, m/s or N."""
        return FULL_SCALES[self.pickup]

    def is_on_node(self, point: float) -> bool:
        """Return True if nothing can be heard there: a fixed end, or a node of the only mode heard."""
        if self.pickup == "bridge":
            return False
        return point in (0.0, 1.0) or (self.solo > 0 and abs(math.sin(math.pi * self.solo * point)) < 1e-3)
