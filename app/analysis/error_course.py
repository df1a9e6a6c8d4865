"""The error of a pluck over time, in windows of a few periods."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from app.analysis.growing import BLOCK_FRAMES
from app.rendering import Take
from engine.compare.relative import ErrorSums

WINDOW_PERIODS = 2.0  # of the fundamental: shorter windows would show its phase
CURVES = ("rmse", "mae", "level_db")


class ErrorCourse:
    """Relative MAE and RMSE of each window, and the level of the model above the truth's. A `Growing`.

    Sums are over all pictures and grid points of a window, as in `ErrorSums`, without the initial picture.

    Attributes:
        ready: windows so far. Pictures after the last whole window are left out.
        middle_s: (windows,), the time of each window's middle.
        curves: (windows,) each. "mae": Σ|û - u|/Σ|u|. "rmse": √(Σ(û - u)²/Σu²). "level_db": 10 log₁₀(Σû²/Σu²), not
            finite where one of them is silent.
    """

    def __init__(self, take: Take) -> None:
        self.take = take
        self.window_frames = max(round(WINDOW_PERIODS * take.picture_hz / take.fundamental_hz), 1)
        self.ready = 0
        self.windows = (take.frames - 1) // self.window_frames
        self.middle_s = (np.arange(self.windows, dtype=np.float64) + 0.5) * self.window_s + 1 / take.picture_hz
        self.curves = {name: np.empty(self.windows) for name in CURVES}

    @property
    def complete(self) -> bool:
        return self.ready == self.windows

    @property
    def window_s(self) -> float:
        return self.window_frames / self.take.picture_hz

    def advance(self) -> bool:
        length = self.window_frames
        count = min((self.take.ready_frames - 1) // length - self.ready, max(math.ceil(BLOCK_FRAMES / length), 1))
        if count <= 0:
            return False
        start, stop = 1 + self.ready * length, 1 + (self.ready + count) * length
        model, truth = (
            self.take.motion_m(name)[start:stop].reshape(count, length, -1) for name in ("model", "truth")
        )
        sums = ErrorSums(length)
        sums.add(model, truth)  # a window counts as a trajectory
        mse, mae = sums.per_trajectory()
        here = slice(self.ready, self.ready + count)
        self.curves["rmse"][here], self.curves["mae"][here] = np.sqrt(mse), mae
        self.curves["level_db"][here] = _level_db(model) - _level_db(truth)
        self.ready += count
        return True


def _level_db(windows_m: NDArray[np.float32]) -> NDArray[np.float64]:
    """The mean square of windows (windows, frames, places) in dB; not a number where there is silence."""
    power = np.einsum("wfp,wfp->w", windows_m, windows_m, dtype=np.float64)
    return 10 * np.log10(power, out=np.full(len(power), np.nan), where=power > 0)
