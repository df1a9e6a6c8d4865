"""The law of a mode that nothing else moves, for Python and compiled code, as `engine.kernels.strings`."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

Number = TypeVar("Number", float, np.ndarray)


def rotation(sigma: Number, omega: Number, time_s: Number) -> tuple[Number, Number, Number, Number]:
    """The exact flow of q̈ + 2σq̇ + (ω² + σ²)q = 0 over a time, (q, v) → (aq + bv, cq + dv): a, b, c, d.

    Args:
        omega: at which the mode swings, √(ω₀² - σ²).
    """
    decay = np.exp(-sigma * time_s)
    cosine = np.cos(omega * time_s)
    sine = np.sin(omega * time_s) / omega
    stiffness = sigma * sigma + omega * omega
    return (decay * (cosine + sigma * sine), decay * sine, -decay * stiffness * sine, decay * (cosine - sigma * sine))
