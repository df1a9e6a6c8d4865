"""What is heard, picked up and exported, and in which bounds: known before the engine is loaded."""

from __future__ import annotations

from typing import Literal, get_args

Source = Literal["model", "truth", "difference", "both"]
Pickup = Literal["displacement", "velocity"]
PICKUPS: tuple[Pickup, ...] = get_args(Pickup)
Bits = Literal["16", "24", "32f"]  # of a WAV's samples
BITS: tuple[Bits, ...] = get_args(Bits)
DIFFERENCE_GAIN_RANGE_DB = (0.0, 80.0)
OTHER = "preset:"  # before the name of another preset whose model is a source
DIFFERENCE = "difference"  # model minus truth
