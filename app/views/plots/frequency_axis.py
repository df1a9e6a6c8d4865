"""What spectrum and spectrogram share: the numbers of a logarithmic frequency axis, and the ranges of levels."""

from __future__ import annotations

import math

LOWEST_HZ = 50.0  # of a logarithmic axis
RANGES_DB = (60, 90, 130)  # below full scale
_LABELLED_HZ = (50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000)


def frequency_ticks() -> list[tuple[float, str]]:
    """The log₁₀ of frequencies in Hz, and their texts: (2.0, "100"), (3.0, "1k")."""
    return [(math.log10(hz), f"{hz:g}" if hz < 1000 else f"{hz / 1000:g}k") for hz in _LABELLED_HZ]
