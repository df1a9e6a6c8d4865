"""A guitar amplifier: how strongly it is driven, and its tone. `engine.kernels.amplifier` has its sound.

Its cabinet is a body: `Body` of the names "cabinet" and "bass_cabinet", or a response that is given.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.kernels.constants import QUANTUM
from engine.kernels.mixer_records import MIXER
from engine.values.effects import Amp


def amplified(amp: Amp, sound: NDArray[np.float64], rate_hz: int, level_db: float = 0.0) -> NDArray[np.float64]:
    """The sound (frames, 2) through the amplifier of a mixer: its first frames, as many."""
    from engine.kernels.amplifier import amplify, drive  # Numba only when it is needed

    mixer = np.zeros(1, MIXER)[0]
    mix = mixer["mix"]
    mixer["rate_hz"] = rate_hz
    drive(mixer, float(amp.drive_db), float(amp.tone_db), float(level_db))
    blocks = np.zeros((-(-len(sound) // QUANTUM) * QUANTUM, 2))
    blocks[: len(sound)] = sound
    for first in range(0, len(blocks), QUANTUM):
        mix[:] = blocks[first : first + QUANTUM]
        amplify(mixer)
        blocks[first : first + QUANTUM] = mix
        mixer["frames"] += QUANTUM
    return blocks[: len(sound)]
