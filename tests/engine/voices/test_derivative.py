"""Velocity from displacement."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from engine.voices.derivative import REACH_FRAMES


@pytest.mark.parametrize("rate_hz", [4_000, 48_000])
def test_velocity_is_the_derivative(rate_hz: int, derivative: Callable[..., np.ndarray]) -> None:
    time_s = np.arange(4000) / rate_hz
    omega = 2 * np.pi * rate_hz * np.array([[0.01, 0.13, 0.31, 0.42]])
    signal = np.cos(omega * time_s[:, np.newaxis])
    exact = -omega * np.sin(omega * time_s[:, np.newaxis])
    inner = slice(0, len(signal) - 2 * REACH_FRAMES)  # the beginning, at rest, is exact as well
    assert (np.abs(derivative(signal, rate_hz) - exact)[inner].max(axis=0) / omega[0]).max() < 6e-4
