"""Gains: how loud each source is played, and how a gain moves to its target without a step."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from app.audio.track import Track

SMOOTHING_S = 0.015  # time constant


@dataclass(frozen=True)
class Levels:
    """What is played of a track, apart from the volume of everything.

    Attributes:
        matched: each source sounds with the track's match gain, once that is known.
        gains_db: by source, stated gains on top; a source that is not named has none.
    """

    matched: bool = False
    gains_db: Mapping[str, float] = field(default_factory=dict)

    def gain(self, track: Track, source: str) -> float:
        gain = 10 ** (self.gains_db.get(source, 0.0) / 20)
        matching = track.match_gains if self.matched else None
        return gain if matching is None else gain * matching.get(source, 1.0)

    def gain_db(self, track: Track, source: str) -> float:
        return 20 * math.log10(self.gain(track, source))


class SmoothGain:
    """A gain that approaches its target exponentially, sample by sample."""

    def __init__(self, gain: float, rate_hz: int) -> None:
        self._gain = gain
        self._per_frame = math.exp(-1 / (SMOOTHING_S * rate_hz))

    def apply(self, samples: NDArray[np.float64], target: float) -> None:
        """Multiplies samples (frames,) or (frames, channels) in place."""
        if self._gain == target or len(samples) == 0:
            if target != 1.0:
                samples *= target
            return
        decay = self._per_frame ** np.arange(1, len(samples) + 1, dtype=np.float64)
        gains = target + (self._gain - target) * decay
        self._gain = float(gains[-1])
        if math.isclose(self._gain, target, rel_tol=1e-9, abs_tol=1e-9):
            self._gain = target
        samples *= gains if samples.ndim == 1 else gains[:, np.newaxis]
