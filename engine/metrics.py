"""Errors of a predicted motion, relative to the true one (the paper's §4.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor


@dataclass(frozen=True)
class RelativeError:
    """Relative errors: Σ(û - u)²/Σu² and Σ|û - u|/Σ|u|, sums over trajectories, frames and points."""

    rel_mse: float
    rel_mae: float


@dataclass(frozen=True)
class WindowError(RelativeError):
    """The relative errors of the frames in start_s ≤ t < stop_s."""

    start_s: float
    stop_s: float


class ErrorSums:
    """Sums per frame over any number of batches, so that a long validation never lies in memory at once."""

    def __init__(self, steps: int) -> None:
        self._sums = torch.zeros(4, steps, dtype=torch.float64)

    def add(self, predicted: Tensor, truth: Tensor, first: int = 0) -> None:
        """Adds trajectories (batch, steps, points) of equal shape; frame 0 (the input) is not among them.

        Args:
            first: where a block of frames belongs: 0 where it starts with frame 1.
        """
        if predicted.shape != truth.shape:
            raise ValueError(f"prediction {tuple(predicted.shape)} and truth {tuple(truth.shape)} differ in shape")
        error = predicted - truth
        terms = (error.square(), truth.square(), error.abs(), truth.abs())
        sums = torch.stack([term.sum(dim=(0, 2), dtype=torch.float64) for term in terms])
        self._sums[:, first : first + truth.shape[1]] += sums.cpu()

    def total(self) -> RelativeError:
        return RelativeError(*self._relative(slice(None)))

    def windows(self, rate_hz: float, edges_s: Sequence[float]) -> list[WindowError]:
        """Errors between successive edges; windows that lie past the last frame are left out."""
        steps = self._sums.shape[1]
        found = []
        for start_s, stop_s in pairwise(edges_s):
            first, last = (min(round(edge * rate_hz), steps) for edge in (start_s, stop_s))
            if last > first:
                found.append(WindowError(*self._relative(slice(first, last)), start_s, stop_s))
        return found

    def _relative(self, frames: slice) -> tuple[float, float]:
        squared, squared_truth, absolute, absolute_truth = self._sums[:, frames].sum(1).tolist()
        return _ratio(squared, squared_truth), _ratio(absolute, absolute_truth)


def relative_error(predicted: Tensor, truth: Tensor) -> RelativeError:
    """The relative error of trajectories (batch, steps, points), frame 0 not among them."""
    sums = ErrorSums(truth.shape[1])
    sums.add(predicted, truth)
    return sums.total()


def _ratio(error: float, truth: float) -> float:
    """error/truth; a silent truth matched by silence is no error, unmatched an infinite one."""
    if truth == 0:
        return 0.0 if error == 0 else float("inf")
    return error / truth
