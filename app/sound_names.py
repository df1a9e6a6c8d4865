"""What is exported and how a string is picked up: known before the engine is loaded."""

from __future__ import annotations

from typing import Literal, get_args

Source = Literal["model", "truth", "difference", "both"]
Pickup = Literal["displacement", "velocity"]
PICKUPS: tuple[Pickup, ...] = get_args(Pickup)
FULL_SCALE_M_S = 30.0  # the velocity that is 0 dBFS: a Gaussian of width 0.08 is as loud as its displacement
