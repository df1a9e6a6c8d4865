"""Effects as they are chosen: an amplifier and a room."""

from __future__ import annotations

from dataclasses import dataclass

from engine import bounds
from engine.parameters import OF_INSTRUMENTS
from engine.values.number import Number


@dataclass(frozen=True)
class Amp:
    """An amplifier for the sum of all strings, in mono: see `engine.kernels.amplifier`. Its cabinet is a body.

    Attributes:
        drive_db: gain before the shape that bends peaks; 0: there is no amplifier.
        tone_db: above 0 what lies above 700 Hz is raised by as much, and what lies below lowered; below 0 the
            reverse.

    Raises:
        ValueError: a value is out of its range; the message names it.
    """

    drive_db: Number = OF_INSTRUMENTS["amp.drive_db"].default
    tone_db: Number = OF_INSTRUMENTS["amp.tone_db"].default

    def __post_init__(self) -> None:
        bounds.check("drive_db", self.drive_db, bounds.AMP_DRIVE_DB, "dB")
        bounds.check("tone_db", self.tone_db, bounds.AMP_TONE_DB, "dB")


@dataclass(frozen=True)
class Room:
    """A room and how much of it is heard: see `engine.effects.room`.

    Attributes:
        mix: 0: none of it, 1: its reverberation alone.
        t60_s: in which the reverberation at 500 Hz falls by 60 dB.

    Raises:
        ValueError: a value is out of its range; the message names it.
    """

    mix: Number = OF_INSTRUMENTS["room.mix"].default
    t60_s: Number = OF_INSTRUMENTS["room.t60_s"].default

    def __post_init__(self) -> None:
        bounds.check("mix", self.mix, (0.0, 1.0))
        bounds.check("t60_s", self.t60_s, bounds.ROOM_T60_S, "s")
