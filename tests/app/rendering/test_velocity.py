"""Velocity from displacement: the derivative, in any blocks."""

from __future__ import annotations

import numpy as np
import pytest

from app.rendering.velocity import REACH_FRAMES, Differentiator


@pytest.mark.parametrize("rate_hz", [4_000, 48_000])
def test_velocity_is_the_derivative(rate_hz: int) -> None:
    time_s = np.arange(4000) / rate_hz
    omega = 2 * np.pi * rate_hz * np.array([[0.01, 0.13, 0.31, 0.42]])
    signal = np.cos(omega * time_s[:, np.newaxis])
    found = Differentiator(rate_hz).feed(signal, last=True)
    exact = -omega * np.sin(omega * time_s[:, np.newaxis])
    inner = slice(0, len(signal) - 2 * REACH_FRAMES)  # the beginning, at rest, is exact as well
    assert (np.abs(found - exact)[inner].max(axis=0) / omega[0]).max() < 6e-4


@pytest.mark.parametrize("block_frames", [1, 65, 1000])
def test_any_splitting_gives_the_same_velocity(block_frames: int) -> None:
    signal = np.random.default_rng(0).standard_normal((1000, 2))
    whole = Differentiator(4_000).feed(signal, last=True)
    differentiator = Differentiator(4_000)
    starts = range(0, len(signal), block_frames)
    parts = [differentiator.feed(signal[k : k + block_frames], k + block_frames >= len(signal)) for k in starts]
    np.testing.assert_allclose(np.concatenate(parts), whole, atol=1e-9)
    assert whole.shape == signal.shape


def test_a_motion_shorter_than_the_filter_is_no_fault() -> None:
    assert Differentiator(4_000).feed(np.ones((5, 1)), last=True).shape == (5, 1)
