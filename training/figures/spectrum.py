"""Spectra of signals at a listening point."""

from __future__ import annotations

import numpy as np

FLOOR_DB = -120.0


def magnitudes(signal: np.ndarray) -> np.ndarray:
    """|DFT| of a signal (samples,) under a Hann window: (samples // 2 + 1,)."""
    return np.abs(np.fft.rfft(signal * np.hanning(len(signal) + 1)[:-1]))


def levels_db(signal: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """The spectrum in dB below the highest peak of the reference's, not lower than FLOOR_DB."""
    peak = magnitudes(reference).max() or 1.0
    return 20 * np.log10(np.maximum(magnitudes(signal) / peak, 10 ** (FLOOR_DB / 20)))


def frequencies_hz(samples: int, rate_hz: float) -> np.ndarray:
    return np.fft.rfftfreq(samples, 1 / rate_hz)
