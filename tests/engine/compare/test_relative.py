"""Relative errors by hand."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch

from engine.compare.relative import (
    NULL_FLOOR_DB,
    ErrorSums,
    ErrorWindows,
    RelativeError,
    error_to_signal,
    relative_error,
)


@pytest.mark.parametrize(
    ("predicted", "truth", "rel_mse", "rel_mae"),
    [
        ([[1.0, -2.0], [2.0, 1.0]], [[1.0, -1.0], [2.0, 0.0]], 2 / 6, 2 / 4),
        ([[0.0, 0.0], [0.0, 0.0]], [[1.0, -1.0], [2.0, 0.5]], 1, 1),
        ([[0.0, 0.0]], [[0.0, 0.0]], 0, 0),
        ([[1.0, 1.0]], [[0.0, 0.0]], math.inf, math.inf),
    ],
)
def test_errors_by_hand(predicted: list[Any], truth: list[Any], rel_mse: float, rel_mae: float) -> None:
    error = relative_error(torch.tensor([predicted]), torch.tensor([truth]))
    assert (error.rel_mse, error.rel_mae) == pytest.approx((rel_mse, rel_mae))
    with pytest.raises(ValueError, match="differ in shape"):
        relative_error(torch.zeros(1, 4, 2), torch.zeros(1, 4, 3))


def test_batches_and_windows_add_up() -> None:
    generator = torch.Generator().manual_seed(0)
    truth, predicted = (torch.randn(6, 100, 3, generator=generator, dtype=torch.float64) for _ in range(2))
    sums = ErrorSums(100)
    for rows in (slice(0, 1), slice(1, 6)):
        sums.add(predicted[rows], truth[rows])
    whole = relative_error(predicted, truth)
    assert sums.total().rel_mse == pytest.approx(whole.rel_mse)
    first, second = sums.windows(100.0, [0, 0.25, 1.0, 2.0, 3.0])
    assert first.rel_mae == pytest.approx(relative_error(predicted[:, :25], truth[:, :25]).rel_mae)
    assert second.rel_mse == pytest.approx(relative_error(predicted[:, 25:], truth[:, 25:]).rel_mse)
    assert (second.start_s, second.stop_s) == (0.25, 1.0)


def motions(*shape: int) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(1)
    truth, predicted = (torch.randn(*shape, generator=generator, dtype=torch.float64) for _ in range(2))
    return predicted, truth


def test_the_first_frames_some_trajectories_and_batches_have_their_own_errors() -> None:
    predicted, truth = motions(5, 50, 3)
    truth[0] *= 100
    sums = ErrorSums(50)
    sums.add(predicted, truth)
    assert sums.total(20).rel_mae == pytest.approx(relative_error(predicted[:, :20], truth[:, :20]).rel_mae)
    assert sums.total(50).rel_mse == sums.total().rel_mse == pytest.approx(sums.of(range(5)).rel_mse)
    assert sums.of([0, 2]).rel_mse == pytest.approx(relative_error(predicted[[0, 2]], truth[[0, 2]]).rel_mse)
    wrong = (predicted - truth).square().sum((1, 2))
    assert sums.shares() == pytest.approx((wrong / wrong.sum()).numpy())
    own = [relative_error(predicted[rows], truth[rows]) for rows in (slice(0, 2), slice(2, 4), slice(4, 5))]
    found = sums.mean_of_batches(2)
    assert found.rel_mse == pytest.approx(np.mean([error.rel_mse for error in own]))
    assert found.rel_mae == pytest.approx(np.mean([error.rel_mae for error in own]))
    assert found.rel_mse != pytest.approx(sums.total().rel_mse, rel=0.01)
    for steps in (0, 51):
        with pytest.raises(ValueError, match=f"steps must lie in 1 … 50, not {steps}"):
            sums.total(steps)


def test_per_frame_and_per_trajectory() -> None:
    predicted, truth = motions(4, 6, 3)
    truth[:, 2], predicted[:, 2] = 0, 0
    sums = ErrorSums(6)
    sums.add(predicted, truth)
    frames, trajectories = sums.per_frame(), sums.per_trajectory()
    assert frames[0].dtype == np.float64
    assert (frames[0].shape, trajectories[0].shape) == ((6,), (4,))
    assert frames[0][2] == 0
    for index, found in enumerate(zip(*frames, strict=True)):
        frame = relative_error(predicted[:, index : index + 1], truth[:, index : index + 1])
        assert found == pytest.approx((frame.rel_mse, frame.rel_mae))
    alone = [relative_error(predicted[row : row + 1], truth[row : row + 1]) for row in range(4)]
    assert trajectories[0] == pytest.approx([error.rel_mse for error in alone])
    assert sums.spread().rel_mse == pytest.approx(np.std([error.rel_mse for error in alone]))
    assert sums.spread().rel_mae == pytest.approx(np.std([error.rel_mae for error in alone]))


def spoilt(shares: list[float], loudness: list[float] | None = None) -> ErrorSums:
    """Sums of trajectories of one frame that are wrong by these shares of their amplitude."""
    truth = torch.tensor(loudness or [1.0] * len(shares), dtype=torch.float64)[:, None, None]
    sums = ErrorSums(1)
    sums.add(truth * (1 + torch.tensor(shares, dtype=torch.float64)[:, None, None]), truth)
    return sums


def test_the_standard_error_of_a_ratio_of_sums_counts_loud_trajectories_more() -> None:
    """A quarter is ten times as loud: the deviation of a ratio to first order, √Σ(eᵢ - R tᵢ)² / Σtᵢ."""
    shares, loudness = [0.01, 0.01, 0.01, 0.2] * 100, [1.0, 1.0, 1.0, 10.0] * 100
    sums = spoilt(shares, loudness)
    truth, wrong = np.array(loudness) ** 2, (np.array(shares) * loudness) ** 2
    expected = np.sqrt(((wrong - sums.total().rel_mse * truth) ** 2).sum()) / truth.sum()
    found = sums.standard_error(20_000)
    assert found.rel_mse == pytest.approx(expected, rel=0.05)
    assert found.rel_mse < sums.spread().rel_mse / 20 / 5  # what the plain deviation of a mean would tell


def test_the_standard_error_of_equal_trajectories_is_that_of_a_mean() -> None:
    """Half of 100 have an error of 0.1, half of 0.3: a draw with replacement is binomial; its deviation is known."""
    found = spoilt([0.1, 0.3] * 50).standard_error(20_000)
    assert found.rel_mae == pytest.approx(0.1 / 100**0.5, rel=0.02)  # the population's deviation over √count
    assert found.rel_mse == pytest.approx((0.09 - 0.01) / 2 / 100**0.5, rel=0.02)


def test_the_standard_error_where_there_is_nothing_to_draw_and_the_depth_of_a_null() -> None:
    assert spoilt([0.5]).standard_error() == RelativeError(0, 0)
    assert spoilt([0.5] * 7).standard_error().rel_mae == pytest.approx(0, abs=1e-12)
    assert spoilt([0.0, 0.0]).shares().tolist() == [0, 0]
    for rel_mse, depth_db in ((1e-3, -30), (0, NULL_FLOOR_DB), (1e-30, NULL_FLOOR_DB), (math.inf, math.inf)):
        assert RelativeError(rel_mse, 0).null_depth_db == pytest.approx(depth_db)
    assert spoilt([0.1, math.inf]).standard_error() == RelativeError(math.inf, math.inf)
    assert spoilt([0.1, 0.2, 0.4]).standard_error() == spoilt([0.1, 0.2, 0.4]).standard_error()


def test_trajectories_are_known_again_in_blocks() -> None:
    predicted, truth = motions(5, 30, 3)
    whole, rows_first, frames_first = ErrorSums(30), ErrorSums(30), ErrorSums(30)
    whole.add(predicted, truth)
    parts, blocks = (slice(0, 2), slice(2, 5)), (slice(0, 7), slice(7, 20), slice(20, 30))
    for rows in parts:
        for frames in blocks:
            rows_first.add(predicted[rows, frames], truth[rows, frames], frames.start)
    for frames in blocks:
        for rows in parts:
            frames_first.add(predicted[rows, frames], truth[rows, frames], frames.start, rows.start)
    for sums in (rows_first, frames_first):
        assert sums.per_trajectory()[0] == pytest.approx(whole.per_trajectory()[0])
        assert sums.spread().rel_mae == pytest.approx(whole.spread().rel_mae)
        assert sums.total().rel_mse == pytest.approx(whole.total().rel_mse)


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e200])
def test_what_is_no_number_is_an_infinite_error_from_then_on(value: float) -> None:
    predicted, truth = motions(3, 10, 2)
    predicted[1, 5:] = value
    sums = ErrorSums(10)
    sums.add(predicted, truth)
    assert sums.total().rel_mse == math.inf
    assert math.isfinite(sums.total(5).rel_mse)
    assert np.isinf(sums.per_frame()[0]).tolist() == [False] * 5 + [True] * 5
    assert np.isinf(sums.per_trajectory()[0]).tolist() == [False, True, False]
    assert sums.spread().rel_mse == math.inf


def test_the_standard_error_of_some_frames_is_that_of_sums_over_them_alone() -> None:
    draw = np.random.default_rng(3)
    predicted, truth = draw.normal(size=(2, 12, 30, 4))
    whole, alone = ErrorSums(30, edges=[20, 10, 90]), ErrorSums(10)
    for first in (0, 7, 14, 21, 28):  # blocks that cross the edges
        whole.add(predicted[:, first : first + 7], truth[:, first : first + 7], first)
    alone.add(predicted[:, 10:20], truth[:, 10:20])
    found, wanted = whole.standard_error(first=10, last=20), alone.standard_error()
    assert (found.rel_mse, found.rel_mae) == pytest.approx((wanted.rel_mse, wanted.rel_mae))
    with pytest.raises(ValueError, match="edges"):
        whole.standard_error(first=11, last=20)


@pytest.mark.parametrize("of", [np.asarray, torch.tensor])
def test_an_error_to_signal_ratio(of: Callable[..., Any]) -> None:
    truth = of([3.0, -4.0])
    assert error_to_signal(truth, truth) == 0
    assert error_to_signal(of([3.0, -3.0]), truth) == pytest.approx(1 / 25)
    assert error_to_signal(truth, 0 * truth, least=50) == 0.5
    assert error_to_signal(of([math.nan, 0.0]), truth) == math.inf


def test_a_prediction_that_is_not_a_number_is_an_infinite_error_in_its_window() -> None:
    windows, truth = ErrorWindows(20, 0.01, 1_000), np.ones((20, 3))
    windows.add(np.where(np.arange(20)[:, None] == 15, np.nan, truth), truth)
    assert windows.curves["rmse"].tolist() == windows.curves["mae"].tolist() == [0.0, math.inf]
    assert windows.rel_mse == math.inf
