"""An impulse response from anywhere: what is refused, and that another rate changes nothing that is heard."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.effects import Impulse

GOOD = np.random.default_rng(0).standard_normal((4000, 2))


def with_one(value: float) -> NDArray[np.float64]:
    samples = GOOD.copy()
    samples[1234, 1] = value
    return samples


@pytest.mark.parametrize(
    ("samples", "rate_hz", "reported"),
    [
        (GOOD, 4_000, "rate"),
        (GOOD, 10**9, "rate"),
        (GOOD[:, :1].repeat(3, 1), 48_000, "channels"),
        (GOOD[:, :0], 48_000, "channels"),
        (GOOD[:, 0], 48_000, "dimensions"),
        (np.zeros((8_000 * 3 + 1, 1)), 8_000, "length"),
        (GOOD[:0], 48_000, "silent"),
        (np.zeros((4000, 1)), 48_000, "silent"),
        (1e-9 * GOOD, 48_000, "silent"),
        (with_one(np.nan), 48_000, "no numbers"),
        (with_one(-np.inf), 48_000, "no numbers"),
        (with_one(1e300), 48_000, "largest sample"),
        (np.sin(np.arange(96_000) * 2 * np.pi * 8 / 48_000)[:, None] * np.hanning(96_000)[:, None], 48_000, "80"),
    ],
)
def test_what_cannot_be_used_is_reported(samples: NDArray[np.float64], rate_hz: int, reported: str) -> None:
    with pytest.raises(ValueError, match=reported):
        Impulse(samples, rate_hz)
