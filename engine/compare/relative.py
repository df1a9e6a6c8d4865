"""Errors of a predicted motion or sound, relative to the true one (the paper's §4.3)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from torch import Tensor

    Motion = NDArray[np.floating[Any]] | Tensor

RESAMPLES = 2000  # of a bootstrap: its standard error is known to 1/√(2 · RESAMPLES), 1.6 %
NULL_FLOOR_DB = -200.0  # of a null depth: what float64 can tell of two equal signals, and finite for a file


@dataclass(frozen=True)
class RelativeError:
    """Relative errors: Σ(û - u)²/Σu² and Σ|û - u|/Σ|u|, sums over trajectories, frames and points."""

    rel_mse: float
    rel_mae: float

    @property
    def null_depth_db(self) -> float:
        """10 log₁₀ of the relative MSE: what is left where prediction and truth are subtracted, -200 dB at least."""
        return max(10 * math.log10(self.rel_mse), NULL_FLOOR_DB) if self.rel_mse > 0 else NULL_FLOOR_DB


@dataclass(frozen=True)
class WindowError(RelativeError):
    """The relative errors of the frames in start_s ≤ t < stop_s."""

    start_s: float
    stop_s: float


class ErrorSums:
    """Sums per frame and per trajectory over any number of blocks: a long validation never lies in memory at once.

    A prediction that is not a number is an infinite error.

    Args:
        steps: frames of each trajectory.
        edges: frames between which trajectories are also summed apart, for `standard_error`.
    """

    def __init__(self, steps: int, edges: Iterable[int] = ()) -> None:
        # four sums: Σ(û - u)², Σu², Σ|û - u| and Σ|u|; here of all trajectories by frame
        self._frames = np.zeros((4, steps))
        self._edges = sorted({0, steps, *(edge for edge in edges if 0 < edge < steps)})
        self._spans = np.zeros((4, 0, len(self._edges) - 1))  # the same by trajectory and stretch between two edges
        self._row = 0  # number of the first trajectory of the last block

    def add(self, predicted: Motion, truth: Motion, first: int = 0, row: int | None = None) -> None:
        """Add trajectories (batch, steps, points) of equal shape; frame 0 (the input) is not among them.

        Args:
            predicted, truth: two arrays, or two tensors of one device.
            first: where a block of frames belongs: 0 where it starts with frame 1.
            row: which trajectory the block's first one is. By default a block with `first` 0 is of new trajectories,
                and any other continues with those of the block before it.
        """
        if predicted.shape != truth.shape:
            raise ValueError(f"prediction {tuple(predicted.shape)} and truth {tuple(truth.shape)} differ in shape")
        error: Any = predicted - truth
        with np.errstate(over="ignore", invalid="ignore"):
            sums = np.stack([_over_points(term) for term in (error**2, truth**2, abs(error), abs(truth))])
        sums[::2][np.isnan(sums[::2])] = math.inf  # of the errors alone
        self._frames[:, first : first + truth.shape[1]] += sums.sum(1)
        if row is None:
            row = self._row if first else self._spans.shape[1]
        self._row, end = row, row + len(truth)
        if (missing := end - self._spans.shape[1]) > 0:
            self._spans = np.concatenate([self._spans, np.zeros((4, missing, len(self._edges) - 1))], axis=1)
        for span, (start, stop) in enumerate(pairwise(self._edges)):
            self._spans[:, row:end, span] += sums[:, :, max(start - first, 0) : max(stop - first, 0)].sum(2)

    def total(self, steps: int | None = None) -> RelativeError:
        """The errors of the first `steps` frames, of all by default.

        Raises:
            ValueError: there are not so many frames, or less than one is asked for.
        """
        if steps is not None and not 1 <= steps <= self._frames.shape[1]:
            raise ValueError(f"steps must lie in 1 … {self._frames.shape[1]}, not {steps}")
        return RelativeError(*_totals(self._frames[:, :steps]))

    def windows(self, rate_hz: float, edges_s: Sequence[float]) -> list[WindowError]:
        """Errors between successive edges; windows that lie past the last frame are left out."""
        steps = self._frames.shape[1]
        errors = []
        for start_s, stop_s in pairwise(edges_s):
            first, last = (min(round(edge * rate_hz), steps) for edge in (start_s, stop_s))
            if last > first:
                errors.append(WindowError(*_totals(self._frames[:, first:last]), start_s, stop_s))
        return errors

    def per_frame(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Relative MSE and MAE of each frame over all trajectories, (steps,) each (the paper's Fig. 4)."""
        return _ratios(self._frames)

    @property
    def _trajectories(self) -> NDArray[np.float64]:
        """(4, trajectories) over all frames."""
        return np.asarray(self._spans.sum(2))

    def per_trajectory(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Relative MSE and MAE of each trajectory over all frames, (trajectories,) each."""
        return _ratios(self._trajectories)

    def mean_of_batches(self, count: int) -> RelativeError:
        """The mean of the relative errors of so many trajectories at a time, in their order; the last may be fewer.

        So the authors' script measures, by batches of 50 (rodrigodzf/physmodjax, `accumulate_metrics`).
        """
        sums = self._trajectories
        batches = [sums[:, first : first + count].sum(1, keepdims=True) for first in range(0, sums.shape[1], count)]
        return RelativeError(*(float(np.mean(errors)) for errors in _ratios(np.concatenate(batches, axis=1))))

    def spread(self) -> RelativeError:
        """The population's standard deviation of the trajectories' own errors; infinite where one of them is."""
        with np.errstate(over="ignore", invalid="ignore"):  # of errors that are infinite, or nearly
            spreads = [float(errors.std()) for errors in self.per_trajectory()]
        return RelativeError(*(spread if math.isfinite(spread) else math.inf for spread in spreads))

    def standard_error(self, resamples: int = RESAMPLES, first: int = 0, last: int | None = None) -> RelativeError:
        """The bootstrap's standard deviation of the errors of some frames, by default all, over trajectories.

        As many trajectories as there are, drawn with replacement, and the ratios of their sums (Efron, Tibshirani, An
        Introduction to the Bootstrap, 1993, ch. 6). The draws are the same every time. Infinite where a trajectory's
        error is; zero for a single one, which says nothing of others.

        Raises:
            ValueError: `first` or `last` is not one of the edges.
        """
        last = self._edges[-1] if last is None else last
        if first not in self._edges or last not in self._edges:
            raise ValueError(f"frames {first} … {last} are not between two edges of {self._edges}")
        sums = self._spans[:, :, self._edges.index(first) : self._edges.index(last)].sum(2)
        count = sums.shape[1]
        if not np.isfinite(sums).all():
            return RelativeError(math.inf, math.inf)
        drawn = np.random.default_rng(0).multinomial(count, np.full(count, 1 / count), size=resamples)
        mse, mae = _ratios(sums @ drawn.T)
        return RelativeError(float(mse.std(ddof=1)), float(mae.std(ddof=1)))

    def of(self, rows: Sequence[int]) -> RelativeError:
        """The errors of some trajectories over all frames."""
        return RelativeError(*_totals(self._trajectories[:, list(rows)]))

    def shares(self) -> NDArray[np.float64]:
        """The share of each trajectory in all squared error, (trajectories,); zeros where there is no error."""
        squared = self._trajectories[0]
        whole = float(squared.sum())
        return squared / whole if whole > 0 else squared.copy()


class ErrorWindows:
    """Relative errors of a motion in windows of a few frames, which grow; any thread may read.

    Attributes:
        ready: windows so far; what lies after the last whole one counts in `rel_mse` alone.
        window_s: of each; `middle_s`: (windows,), of its middle.
        curves: (windows,) each. "rmse": √(Σ(û - u)²/Σu²). "mae": Σ|û - u|/Σ|u|. "level_db": 10 log₁₀(Σû²/Σu²), not
            a number where one of them is silent.

    Args:
        frames: of the whole motion, after the first, at time 0.
        window_s: is rounded to frames.
    """

    def __init__(
        self, frames: int, window_s: float, rate_hz: float, curves: Sequence[str] = ("rmse", "mae", "level_db")
    ) -> None:
        self._window_frames = max(round(window_s * rate_hz), 1)  # frames of a window
        self.windows = frames // self._window_frames
        self.ready = 0
        self._done = 0  # frames so far
        self.window_s = self._window_frames / rate_hz
        self.middle_s = (np.arange(self.windows, dtype=np.float64) + 0.5) * self.window_s + 1 / rate_hz
        self.curves = {name: np.full(self.windows, np.nan) for name in curves}
        # of (û - u)², u², û², |û - u| and |u|, by window; the last is what follows the last whole window
        self._sums = np.zeros((5, self.windows + 1))

    @property
    def rel_mse(self) -> float:
        """The relative error of all frames so far; not a number where the truth rests."""
        wrong, true = self._sums[:2].sum(1)
        return float(wrong / true) if true > 0 else math.nan

    def add(
        self, model: NDArray[np.floating], truth: NDArray[np.floating], weight: NDArray[np.float64] | None = None
    ) -> None:
        """Add the next frames, (frames, points) each; `weight` (points,) is that of a square, 1 by default."""
        error, window = model - truth, (self._done + np.arange(len(model))) // self._window_frames
        weights = np.ones(model.shape[1]) if weight is None else weight
        terms = [np.einsum("fp,fp,p->f", part, part, weights, dtype=np.float64) for part in (error, truth, model)]
        if "mae" in self.curves:
            terms += [np.abs(part).sum(1, dtype=np.float64) for part in (error, truth)]
        for row, values in enumerate(terms):
            if row in (0, 3):  # a prediction that is not a number is an infinite error
                values[np.isnan(values)] = math.inf
            self._sums[row] += np.bincount(np.minimum(window, self.windows), values, self.windows + 1)
        self._done += len(model)
        ready = min(self._done // self._window_frames, self.windows)
        sums = self._sums[:, self.ready : ready]
        mse, mae = _ratios(sums[[0, 1, 3, 4]])
        with np.errstate(divide="ignore", invalid="ignore"):
            level_db = np.where((sums[2] > 0) & (sums[1] > 0), 10 * np.log10(sums[2] / sums[1]), math.nan)
        for name, values in (("rmse", np.sqrt(mse)), ("mae", mae), ("level_db", level_db)):
            if name in self.curves:
                self.curves[name][self.ready : ready] = values
        self.ready = ready


def relative_error(predicted: Motion, truth: Motion) -> RelativeError:
    """The relative error of trajectories (batch, steps, points), frame 0 not among them."""
    sums = ErrorSums(truth.shape[1])
    sums.add(predicted, truth)
    return sums.total()


def error_to_signal(motion: Motion, truth: Motion, least: float = 1e-30) -> float:
    """Σ(û - u)²/Σu² of two sounds or motions of one shape; infinite where it is not a number.

    Args:
        least: what the truth's Σu² counts as at least, so that silence has an error too.
    """
    error: Any = motion - truth
    squared: Any = truth**2
    ratio = float((error**2).sum()) / max(float(squared.sum()), least)
    return ratio if math.isfinite(ratio) else math.inf


def _over_points(terms: Any) -> NDArray[np.float64]:
    """Sums (batch, steps) of terms (batch, steps, points) in double precision."""
    if isinstance(terms, np.ndarray):
        return np.asarray(terms.sum(2, dtype=np.float64))
    import torch

    return np.asarray(terms.sum(dim=2, dtype=torch.float64).cpu().numpy())


def _totals(sums: NDArray[np.float64]) -> tuple[float, float]:
    """Relative MSE and MAE of the sums (4, n) of `_ratios`, added up over n."""
    mse, mae = _ratios(sums.sum(1, keepdims=True))
    return float(mse[0]), float(mae[0])


def _ratios(sums: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Relative MSE and MAE, (n,) each, of sums (4, n): Σ(û - u)², Σu², Σ|û - u| and Σ|u|.

    A silent truth matched by silence is no error, unmatched an infinite one.
    """
    error, truth = sums[::2], sums[1::2]
    with np.errstate(divide="ignore", invalid="ignore"):
        mse, mae = np.where(truth == 0, np.where(error == 0, 0.0, math.inf), error / truth)
    return mse, mae
