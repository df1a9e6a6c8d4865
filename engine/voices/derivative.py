"""The filter that makes velocity of displacement, for the mixer's voices and for whole signals alike."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.kernels.mixer_records import REACH

REACH_FRAMES = REACH  # of the filter to either side
_KAISER_BETA = 8.0


def differentiator_taps(rate_hz: int) -> NDArray[np.float64]:
    """Taps of the derivative of a band-limited signal, per second: a Kaiser-windowed ideal differentiator.

    Its phase is exact, for the taps are odd about the middle. Its gain true within 0.12 % up to 0.9 of half the rate.

    Returns:
        `2 * REACH_FRAMES + 1` taps, the one for the earliest sample first.
    """
    distance = np.arange(1, REACH_FRAMES + 1)
    window = np.kaiser(2 * REACH_FRAMES + 1, _KAISER_BETA)[REACH_FRAMES + 1 :]
    half = rate_hz * np.where(distance % 2, 1.0, -1.0) / distance * window
    return np.concatenate([-half[::-1], [0.0], half])
