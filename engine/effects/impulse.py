"""An impulse response as a value that is checked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine import bounds
from engine.kernels.constants import LOUDNESS_HIGH_HZ, LOUDNESS_LOW_HZ

PEAK = (1e-6, 1e6)
LARGEST_GAIN = 1e3  # at any frequency, of a response that is as loud as what it is given


@dataclass(frozen=True, eq=False)
class Impulse:
    """An impulse response from anywhere, (frames, 1 or 2).

    Raises:
        ValueError: it is too long, has too many channels, is silent or inaudible, or has samples that are no numbers.
    """

    samples: NDArray[np.float64]
    rate_hz: int

    def __post_init__(self) -> None:
        bounds.check("its rate", self.rate_hz, bounds.IMPULSE_RATE_HZ, "Hz")
        if self.samples.ndim != 2:
            raise ValueError(f"an impulse response is (frames, channels), not of {self.samples.ndim} dimensions")
        bounds.check("its channels", self.samples.shape[1], (1, bounds.MOST_IMPULSE_CHANNELS))
        bounds.check("its length", len(self.samples) / self.rate_hz, (0.0, bounds.LONGEST_IMPULSE_S), "s")
        if not np.isfinite(self.samples).all():
            raise ValueError("it has samples that are no numbers")
        peak = float(np.abs(self.samples).max(initial=0.0))
        if peak < PEAK[0]:
            raise ValueError("it is silent")
        bounds.check("its largest sample", peak, PEAK)
        from engine.effects.responses import as_loud  # brings the compiler

        size = 1 << (2 * len(self.samples) - 1).bit_length()
        if not np.abs(np.fft.rfft(as_loud(self.samples, self.rate_hz), size, axis=0)).max() <= LARGEST_GAIN:
            raise ValueError(f"it has next to nothing between {LOUDNESS_LOW_HZ:g} and {LOUDNESS_HIGH_HZ:g} Hz")
