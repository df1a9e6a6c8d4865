"""A soft tone that says which loudspeaker is which, and that there is one."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Side = Literal["left", "right", "both"]

TONE_HZ = 440.0
TONE_S = 1.0
LEVEL_DB = -20.0
FADE_S = 0.02


class Tone:
    """`TONE_S` of a sine on one side or both; any splitting into blocks gives the same samples."""

    def __init__(self, rate_hz: int, side: Side) -> None:
        self._rate_hz = rate_hz
        self._gains = np.array([side != "right", side != "left"], np.float32)
        self._done_frames = 0

    @property
    def over(self) -> bool:
        return self._done_frames >= TONE_S * self._rate_hz

    def next_block(self, frames: int) -> NDArray[np.float32]:
        """The next samples, shape (frames, 2); silence after the end."""
        time_s = (self._done_frames + np.arange(frames)) / self._rate_hz
        self._done_frames += frames
        envelope = np.clip(np.minimum(time_s, TONE_S - time_s) / FADE_S, 0, 1)
        wave = 10 ** (LEVEL_DB / 20) * envelope * np.sin(2 * np.pi * TONE_HZ * time_s)
        return wave.astype(np.float32)[:, np.newaxis] * self._gains
