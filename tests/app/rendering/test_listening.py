"""Listening points, solo and pick-up: what is read off a motion."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from app.rendering.velocity import REACH_FRAMES, Differentiator
from engine.sine_transform import listening_weights, to_grid
from engine.voices import Ear

POINTS = 101


def test_without_solo_it_is_the_engines_listening_point() -> None:
    weights = Ear((0.37, 0.61)).weights(POINTS)
    torch.testing.assert_close(weights, listening_weights(torch.tensor([0.37, 0.61], dtype=torch.float64), POINTS))


def test_solo_reads_one_mode_at_the_listening_point() -> None:
    amplitudes = torch.randn(25, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    motion = to_grid(amplitudes, POINTS)
    for mode in (1, 7, 25):
        heard = motion @ Ear((0.37,), solo=mode).weights(POINTS)[:, 0]
        assert float(heard) == pytest.approx(float(amplitudes[mode - 1]) * np.sin(np.pi * mode * 0.37), abs=1e-12)
    everything = sum(motion @ Ear((0.37,), solo=mode).weights(POINTS)[:, 0] for mode in range(1, POINTS - 1))
    assert float(everything) == pytest.approx(float(motion @ Ear((0.37,)).weights(POINTS)[:, 0]), abs=1e-12)
    assert not Ear((0.37,), solo=POINTS).weights(POINTS).any()


def test_nodes_are_known() -> None:
    assert Ear((0.5,), solo=2).is_on_node(0.5)
    assert not Ear((0.5,), solo=3).is_on_node(0.5)
    assert Ear((0.0,)).is_on_node(0.0)
    assert not Ear((0.5,)).is_on_node(0.5)


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
