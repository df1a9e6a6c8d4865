"""What is exported and how a string is picked up, by name: known before the engine is loaded."""

from __future__ import annotations

from typing import Literal, get_args

Source = Literal["model", "truth", "difference", "both"]
Pickup = Literal["displacement", "velocity"]
PICKUPS: tuple[Pickup, ...] = get_args(Pickup)
