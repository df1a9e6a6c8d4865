"""The safety limiter of playback: whatever a model puts out, ears get no more than the ceiling."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

CEILING_DB = -0.3
CEILING = 10 ** (CEILING_DB / 20)
RELEASE_S = 0.08
RUNAWAY = 100.0  # +40 dBFS: the level that is believed at most, so that one wild sample mutes 0.4 s and not minutes

_LONGEST_CHUNK_FRAMES = 8192  # keeps release**-frames, used below, far from overflow


class Limiter:
    """Peak limiter without look-ahead: instant attack, exponential release, then a hard clip at the ceiling.

    The level is `e[n] = max(|x[n]|, r·e[n-1])` and the gain `min(1, ceiling / e[n])`, so a signal that stays
    below the ceiling passes bit for bit. Channels are linked: the louder one sets the gain of both, so that
    the picture in stereo does not wander. It belongs to playback only; exported files never see it.
    """

    def __init__(self, rate_hz: int) -> None:
        self._release = math.exp(-1 / (RELEASE_S * rate_hz))
        self._level = 0.0
        self._gain_reduction_db = 0.0

    @property
    def gain_reduction_db(self) -> float:
        """The strongest reduction within the last block, as a number ≥ 0; 0 means untouched."""
        return self._gain_reduction_db

    def process(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Limits finite samples, (frames,) or (frames, channels); any splitting into blocks gives the same."""
        if samples.size == 0:
            return samples
        believed = np.clip(samples, -RUNAWAY, RUNAWAY)
        magnitudes = np.abs(believed).reshape(len(samples), -1)
        loudest = magnitudes[:, 0] if magnitudes.shape[1] == 1 else magnitudes.max(axis=1)
        levels = np.empty_like(loudest)
        for start in range(0, len(samples), _LONGEST_CHUNK_FRAMES):
            chunk = slice(start, start + _LONGEST_CHUNK_FRAMES)
            levels[chunk] = self._follow(loudest[chunk])
        highest = float(levels.max())
        if highest <= CEILING:
            self._gain_reduction_db = 0.0
            return samples
        self._gain_reduction_db = 20 * math.log10(highest / CEILING)
        gains = np.minimum(1.0, CEILING / np.maximum(levels, CEILING))
        return np.clip(believed * (gains if samples.ndim == 1 else gains[:, np.newaxis]), -CEILING, CEILING)

    def _follow(self, magnitudes: NDArray[np.float64]) -> NDArray[np.float64]:
        # The recursion, unrolled: e[n] = r^n · max over k ≤ n of |x[k]|·r^-k, with the old level as x[-1].
        decay = self._release ** np.arange(1, magnitudes.size + 1, dtype=np.float64)
        highest = np.maximum(np.maximum.accumulate(magnitudes / decay), self._level)
        levels = decay * highest
        self._level = float(levels[-1])
        return levels
