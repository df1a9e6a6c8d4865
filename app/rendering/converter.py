"""A sample-rate converter that gives sound as soon as there is any."""

from __future__ import annotations

import numpy as np
import soxr
from numpy.typing import NDArray

QUALITY = "HQ"
PROMPT_S = 0.6  # for so long at the beginning the converter is helped to be prompt
GUARD_FRAMES = 48  # this near to the end of what was fed, a converted beginning is not yet exact (−85 dB)


class PromptConverter:
    """soxr's stream, whose first samples come 40 ms late at 16 kHz and 300 ms late at 4 kHz, made prompt.

    At the beginning what has been fed so far is converted as a whole as well, continued beyond its end by its
    point reflection, and what is exact of that is given out ahead; the stream takes over where it has caught up.
    Both are the same samples, but for the guard's error.

    Args:
        rate_hz: Of what is fed.
        sound_rate_hz: Of what comes out.
        channels: 1 or 2.
    """

    def __init__(self, rate_hz: int, sound_rate_hz: int, channels: int) -> None:
        self._rates = (rate_hz, sound_rate_hz)
        self._stream = soxr.ResampleStream(rate_hz, sound_rate_hz, channels, dtype="float32", quality=QUALITY)
        self._beginning: NDArray[np.float32] | None = np.zeros((0, channels), np.float32)
        self._streamed = 0  # frames that the stream has given
        self._given = 0  # frames that have been given out

    def feed(self, block: NDArray[np.float32], last: bool = False) -> NDArray[np.float32]:
        """Takes (frames, channels) and gives what is new, (any number of frames, channels)."""
        out = self._stream.resample_chunk(block, last=last).reshape(-1, block.shape[1])
        ahead = max(0, self._given - self._streamed)
        self._streamed += len(out)
        fresh = out[ahead:]
        self._given = max(self._given, self._streamed)
        if self._beginning is None or last:
            return fresh
        self._beginning = np.concatenate([self._beginning, block])
        early = self._ahead_of_stream(self._beginning)
        if len(self._beginning) > PROMPT_S * self._rates[0]:
            self._beginning = None
        self._given += len(early)
        return np.concatenate([fresh, early])

    def _ahead_of_stream(self, beginning: NDArray[np.float32]) -> NDArray[np.float32]:
        rate_hz, sound_rate_hz = self._rates
        exact = int((len(beginning) - GUARD_FRAMES) * sound_rate_hz / rate_hz)
        if exact <= self._given:
            return beginning[:0]
        behind = 2 * beginning[-1:] - beginning[-2 : -2 * GUARD_FRAMES - 2 : -1]
        whole = soxr.resample(np.concatenate([beginning, behind]), rate_hz, sound_rate_hz, QUALITY)
        return whole[self._given : exact]
