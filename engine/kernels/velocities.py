"""The laws of velocity: how hard a key plucks or strikes. Plain functions, as `engine.kernels.strings`."""

from __future__ import annotations

import math


def share(velocity: float, curve: float) -> float:
    """The share of the way from the softest to the hardest stroke, 0 … 1, of a velocity in 1 … 127."""
    return float(min(max((velocity - 1) / 126, 0.0), 1.0) ** (4.0**-curve))


def between(softest: float, hardest: float, share: float) -> float:
    """The value at a share of the way, of which equal steps are equal ratios."""
    return softest * (hardest / softest) ** share


def contact_s(softest_ms: float, hardest_ms: float, share: float) -> float:
    """The time in which a pluck releases the string, or a hammer touches it; 0: at once."""
    if softest_ms <= 0.0 or hardest_ms <= 0.0:
        return 0.0
    return between(softest_ms, hardest_ms, share) / 1000


def velocity(softest: float, hardest: float, value: float, curve: float) -> int:
    """The velocity, 1 … 127, whose value is nearest: as `between`, of its share."""
    if value <= softest or hardest <= softest:
        return 1
    share = min(math.log(value / softest) / math.log(hardest / softest), 1.0)
    return round(1 + share ** (4.0**curve) * 126)
