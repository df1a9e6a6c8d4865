"""What is exported and how a string is picked up: known before the engine is loaded."""

from __future__ import annotations

from typing import Literal, get_args

Source = Literal["model", "truth", "difference", "both"]
Pickup = Literal["displacement", "velocity"]
PICKUPS: tuple[Pickup, ...] = get_args(Pickup)
OTHER = "preset:"  # before the name of another preset whose model is a source
DIFFERENCE = "difference"  # model minus truth
