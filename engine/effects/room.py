"""A gentle room: the stereo impulse response of a box of six walls, without its direct sound.

Early reflections are its image sources (J. B. Allen and D. A. Berkley, "Image method for efficiently simulating
small-room acoustics", J. Acoust. Soc. Am. 65 (1979) 943). Their number grows with the square of time. They soon are
noise of a known power, 4πc/V a second at a metre from the source; it takes over at the mixing time. Both
decay with a T60 that falls with frequency, as air and walls have it.

Why a response and not a network of delays: it goes through the one convolution that the body needs anyway. It is
the same to the sample in a file, and rings on unchanged while it is exchanged. `engine.kernels.rooms` computes it.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine import bounds
from engine.kernels.constants import ROOM_HZ

NOISE_FRAMES = round(bounds.ROOM_T60_S[1] * ROOM_HZ)  # of the longest room
_SEED = 1


@lru_cache(maxsize=8)
def room_response(t60_s: float, rate_hz: int) -> NDArray[np.float64]:
    """The response of the reverberation alone, (frames, 2), as loud as what it is given; not to be written."""
    from engine.effects.responses import work_space  # brings the compiler
    from engine.kernels import responses, rooms

    made = np.array(room_noise()[: rooms.room_frames(float(t60_s))])
    response = np.empty((responses.resampled_frames(len(made), ROOM_HZ, float(rate_hz)), 2))
    work = work_space(max(responses.work_size(len(made), ROOM_HZ, float(rate_hz)), int(rate_hz)))
    rooms.respond(work, float(t60_s), made, float(rate_hz), response)
    response.setflags(write=False)
    return response


def room_noise() -> NDArray[np.float64]:
    """Noise of power 1, (NOISE_FRAMES, 2), from which late reflections are made by decay: the same in every room."""
    return np.random.default_rng(_SEED).standard_normal((NOISE_FRAMES, 2))
