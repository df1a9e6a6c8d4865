"""Velocity from displacement, block by block at the motion's own rate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.voices.derivative import REACH_FRAMES, differentiator_taps


class Differentiator:
    """The derivative of a band-limited signal.

    Before its first frame a string is at rest, and one without damping would move through that frame
    symmetrically in time, so the signal is continued backwards as its mirror image: the velocity begins at zero.
    Behind its last frame the signal is turned about that frame, which keeps its slope.
    """

    def __init__(self, rate_hz: int) -> None:
        self._taps = differentiator_taps(rate_hz)[::-1]  # `np.convolve` turns them again
        self._kept: NDArray[np.float64] | None = None  # the last inputs, mirrored where there are none before
        self._early: list[NDArray[np.float64]] = []  # inputs until there are enough of them for the mirror

    def feed(self, block: NDArray[np.floating], last: bool = False) -> NDArray[np.float64]:
        """Takes displacement (frames, points) and yields velocity per second, `REACH_FRAMES` late; all with `last`.

        Any splitting into blocks gives the same signal; in all there is one frame for each that was fed.
        """
        given = np.asarray(block, np.float64)
        if self._kept is None:
            self._early.append(given)
            begun = np.concatenate(self._early)
            if len(begun) <= REACH_FRAMES and not last:
                return begun[:0]
            reach = min(REACH_FRAMES, len(begun) - 1)
            mirrored = np.pad(begun[1 : reach + 1][::-1], ((REACH_FRAMES - reach, 0), (0, 0)), "edge")
            signal = np.concatenate([mirrored, begun])
            self._early = []
        else:
            signal = np.concatenate([self._kept, given])
        if last:
            behind = signal[-REACH_FRAMES - 1 : -1][::-1]
            signal = np.concatenate([signal, 2 * signal[-1:] - behind])
        self._kept = signal[max(0, len(signal) - 2 * REACH_FRAMES) :]
        if len(signal) <= 2 * REACH_FRAMES:
            return signal[:0]
        return np.stack([np.convolve(column, self._taps, "valid") for column in signal.T], axis=1)
