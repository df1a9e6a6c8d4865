"""The transforms of `fno` as small real matrix products, half as long by symmetry.

With the origin in the middle of the string a real part sees only its symmetric and an imaginary part only its
antisymmetric half. Moving the origin multiplies each frequency by a phase, which commutes with a product at each
frequency and is undone on the way back.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]
Pair = tuple[Array, Array]


@cache
def transform_matrices(points: int) -> Pair:
    """`exact_matrices` in single precision."""
    forward, inverse = exact_matrices(points)
    return forward.astype(np.float32), inverse.astype(np.float32)


def exact_matrices(points: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The folded transform (2, frequencies, half) and its inverse (2, half, frequencies), half = points // 2 + 1.

    For fields of `points` values that are followed by as many zeros. The highest frequency of a real transform of
    2·points values is not kept.
    """
    k = np.arange(points)[:, None]
    angle = np.pi * k * (np.arange(points // 2 + 1) - points / 2) / points
    forward = np.stack([np.cos(angle), -np.sin(angle)])
    inverse = (forward * np.where(k == 0, 0.5, 1.0) / points).transpose(0, 2, 1)
    return forward, np.ascontiguousarray(inverse)
