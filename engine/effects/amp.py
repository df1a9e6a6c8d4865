"""A guitar amplifier: how strongly it is driven, and its tone. `engine.kernels.amplifier` has its sound.

Its cabinet is a body: `Body` of the names "cabinet" and "bass_cabinet", or a response that is given.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine import bounds
from engine.kernels.constants import QUANTUM
from engine.kernels.mixer_records import MIXER


@dataclass(frozen=True)
class Amp:
    """An amplifier for the sum of all strings, whose sound is in mono.

    Attributes:
        drive_db: gain before the shape that bends peaks; 0: there is no amplifier.
        tone_db: above 0 what lies above 700 Hz is raised by as much, and what lies below lowered; below 0 the
            reverse.
        level_db: of its input, which its output has too: it changes no drive.

    Raises:
        ValueError: a value is out of its range; the message names it.
    """

    drive_db: float = 0.0
    tone_db: float = 0.0
    level_db: float = 0.0

    def __post_init__(self) -> None:
        bounds.check("drive_db", self.drive_db, bounds.AMP_DRIVE_DB, "dB")
        bounds.check("tone_db", self.tone_db, bounds.AMP_TONE_DB, "dB")


def amplified(amp: Amp, sound: NDArray[np.float64], rate_hz: int) -> NDArray[np.float64]:
    """The sound (frames, 2) through the amplifier of a mixer: its first frames, as many."""
    from engine.kernels.amplifier import amplify, drive  # Numba only when it is needed

    mixer = np.zeros(1, MIXER)[0]
    mix = mixer["mix"]
    mixer["rate_hz"] = rate_hz
    drive(mixer, float(amp.drive_db), float(amp.tone_db), float(amp.level_db))
    found = np.zeros((-(-len(sound) // QUANTUM) * QUANTUM, 2))
    found[: len(sound)] = sound
    for first in range(0, len(found), QUANTUM):
        mix[:] = found[first : first + QUANTUM]
        amplify(mixer)
        found[first : first + QUANTUM] = mix
        mixer["frames"] += QUANTUM
    return found[: len(sound)]
