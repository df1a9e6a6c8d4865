"""Pieces so small that NumPy keeps the interpreter from the first of them to the last.

For more than 500 numbers it lets go of it, and whoever paints or renders meanwhile may keep it for milliseconds: a
block of 512 frames then takes up to 20 ms, with dozens of such pauses, and in pieces no more than a dozen.
"""

from __future__ import annotations

from collections.abc import Iterator

PIECE_FRAMES = 250  # of two channels


def pieces(frames: int) -> Iterator[slice]:
    """Slices that make up 0 … frames."""
    for start in range(0, frames, PIECE_FRAMES):
        yield slice(start, min(start + PIECE_FRAMES, frames))
