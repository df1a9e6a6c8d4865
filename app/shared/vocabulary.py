"""Names of sources, pick-ups, sample formats and faces, here so that they are known before the engine is loaded."""

from __future__ import annotations

from typing import Literal, get_args

from engine.values.ear import Pickup

Source = Literal["model", "truth", "difference", "both"]
PlayedSource = Literal["model", "truth", "difference"]  # of an instrument
PICKUP_TITLES: dict[Pickup, str] = {"displacement": "Point", "velocity": "Magnetic", "bridge": "Bridge"}
Face = Literal["play", "lab"]  # of the window
Bits = Literal["16", "24", "32f"]  # of a file's samples; f: floating point
BITS: tuple[Bits, ...] = get_args(Bits)
Format = Literal["wav 16", "wav 24", "wav 32f", "flac 16", "flac 24"]  # of files that are written: ending and bits
FORMATS: tuple[Format, ...] = get_args(Format)
WRITTEN_ENDINGS = tuple(dict.fromkeys("." + name.split()[0] for name in FORMATS))
DIFFERENCE_GAIN_RANGE_DB = (0.0, 80.0)
OTHER = "preset:"  # prefix of a source that is another preset's model: "preset:NAME"
DIFFERENCE = "difference"  # model minus truth
