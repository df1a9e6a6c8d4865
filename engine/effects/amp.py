"""A guitar amplifier: how strongly it is driven, and its tone. `engine.kernels.amplifier` has its sound.

Its cabinet is a body: `Body` of the names "cabinet" and "bass_cabinet", or a response that is given.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from engine.values.effects import Amp

NOMINAL = 0.15  # of full scale: a tone of this peak keeps its level, whatever the drive


def factors(amp: Amp | None, level_db: float = 0.0) -> tuple[float, float, float]:
    """The mixer's factors: before the shape, behind it, and of the tone. All 0 without an amplifier.

    Args:
        level_db: of its input, which its output has too: it changes no drive.
    """
    if amp is None or amp.drive_db == 0:
        return 0.0, 0.0, 0.0
    drive, level = 10 ** (amp.drive_db / 20), 10 ** (level_db / 20)
    return drive / level, level * math.sqrt(1 + (drive * NOMINAL) ** 2) / drive, 10 ** (amp.tone_db / 20)


def amplified(amp: Amp, sound: NDArray[np.float64], rate_hz: int, level_db: float = 0.0) -> NDArray[np.float64]:
    """The sound (frames, 2) through the amplifier of a mixer: its first frames, as many."""
    from engine.kernels import layout as at
    from engine.kernels.amplifier import amplify  # Numba only when it is needed

    mixer = np.zeros(at.MIXER_SLOTS)
    counts, mix = mixer.view(np.int64), mixer[at.M_MIX : at.M_MIX + 2 * at.QUANTUM].reshape(at.QUANTUM, 2)
    mixer[at.M_RATE] = rate_hz
    mixer[at.M_AMPLIFIER : at.M_AMPLIFIER + 3] = factors(amp, level_db)
    found = np.zeros((-(-len(sound) // at.QUANTUM) * at.QUANTUM, 2))
    found[: len(sound)] = sound
    for first in range(0, len(found), at.QUANTUM):
        mix[:] = found[first : first + at.QUANTUM]
        amplify(mixer)
        found[first : first + at.QUANTUM] = mix
        counts[at.M_FRAMES] += at.QUANTUM
    return found[: len(sound)]
