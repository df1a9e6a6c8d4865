"""The compiled sum over latents at listening points, for which no frame of latents is ever written."""

from __future__ import annotations

import numpy as np
from numba import njit

from engine.kernels.compiled import COMPILED


@njit(**COMPILED)
def listen(factors: np.ndarray, weights: np.ndarray, frames: np.ndarray) -> None:
    """Writes frames[b, s, j, p] = Re Σ_n weights[p, n] z_n(j), where each log z_n is a cubic in j.

    A cubic's third difference is constant, so its exponential is advanced by three products and no sine:
    z ← z r, r ← r s, s ← s c. In double precision the error after j frames is of the order of 1e-16 j³.

    Args:
        factors: z, r, s and c at the segments' first frames, (2, 4, batch, segments, n), real parts first.
        weights: (2, points, n), the real and the imaginary parts' weights in that sum.
        frames: (batch, segments, frames of a segment, points).
    """
    _, _, batch, segments, n = factors.shape
    length, points = frames.shape[2:]
    row = np.empty((2, 4, n))
    for b in range(batch):
        for segment in range(segments):
            row[:] = factors[:, :, b, segment]
            for j in range(length):
                for p in range(points):
                    total = 0.0
                    for i in range(n):
                        total += weights[0, p, i] * row[0, 0, i] + weights[1, p, i] * row[1, 0, i]
                    frames[b, segment, j, p] = total
                for k in range(3):
                    for i in range(n):
                        re, im = row[0, k, i], row[1, k, i]
                        by_re, by_im = row[0, k + 1, i], row[1, k + 1, i]
                        row[0, k, i] = re * by_re - im * by_im
                        row[1, k, i] = re * by_im + im * by_re
