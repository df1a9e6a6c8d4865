"""Median, 99th percentile and maximum of times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Spread:
    """Statistics of several times, in ms."""

    median: float
    p99: float
    worst: float

    @classmethod
    def of(cls, values_s: list[float]) -> Spread | None:
        """Of times in s; None where there are none."""
        if not values_s:
            return None
        ms = 1000 * np.array(values_s)
        return cls(float(np.median(ms)), float(np.quantile(ms, 0.99)), float(ms.max()))
