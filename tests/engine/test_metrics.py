"""Relative errors by hand."""

import pytest
import torch

from engine.metrics import ErrorSums, relative_error


def test_by_hand() -> None:
    truth = torch.tensor([[[1.0, -1.0], [2.0, 0.0]]])
    predicted = torch.tensor([[[1.0, -2.0], [2.0, 1.0]]])
    error = relative_error(predicted, truth)
    assert error.rel_mse == pytest.approx((1 + 1) / (1 + 1 + 4))
    assert error.rel_mae == pytest.approx((1 + 1) / (1 + 1 + 2))


def test_silence_predicted_is_an_error_of_one() -> None:
    truth = torch.randn(2, 5, 3)
    error = relative_error(torch.zeros_like(truth), truth)
    assert (error.rel_mse, error.rel_mae) == pytest.approx((1, 1))


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


def test_silent_truth() -> None:
    silence = torch.zeros(1, 4, 2)
    assert relative_error(silence, silence).rel_mse == 0
    assert relative_error(silence + 1, silence).rel_mae == float("inf")


def test_shapes_must_agree() -> None:
    with pytest.raises(ValueError, match="differ in shape"):
        relative_error(torch.zeros(1, 4, 2), torch.zeros(1, 4, 3))
