"""A complex Fourier transform that needs no memory of its own.

Stockham's self-sorting form with factors of four and one of two: C. Van Loan, "Computational Frameworks for the Fast
Fourier Transform", SIAM 1992, section 1.7. Libraries that Numba can call (rocket-fft) make a new array with each
call and look their plan up behind a lock, which the device's thread must not do.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from engine.kernels.compiled import COMPILED


@njit(**COMPILED)
def transform(
    re: np.ndarray, im: np.ndarray, re2: np.ndarray, im2: np.ndarray, cosines: np.ndarray, sines: np.ndarray
) -> None:
    """Replaces re + i·im, of n = 128, 512, 2048 … numbers (2·4ᵏ, k odd), by Σ (re + i·im)[t] exp(−2πi kt/n).

    With real and imaginary parts exchanged in the call it is the inverse, times n.

    Args:
        re2, im2: as much room again.
        cosines, sines: of 2πk/N for k = 0 … N − 1, N being a multiple of n.
    """
    n = len(re)
    unit = len(cosines) // n
    left, stride = n, 1
    while left > 1:
        if left % 4 == 0:
            _fours(re, im, re2, im2, cosines, sines, left // 4, stride, unit * stride)
            left, stride = left // 4, stride * 4
        else:
            for q in range(stride):
                re2[q], im2[q] = re[q] + re[q + stride], im[q] + im[q + stride]
                re2[q + stride], im2[q + stride] = re[q] - re[q + stride], im[q] - im[q + stride]
            left, stride = left // 2, stride * 2
        re, im, re2, im2 = re2, im2, re, im


@njit(**COMPILED)
def _fours(
    re: np.ndarray,
    im: np.ndarray,
    re2: np.ndarray,
    im2: np.ndarray,
    cosines: np.ndarray,
    sines: np.ndarray,
    count: int,
    stride: int,
    unit: int,
) -> None:
    """Compute one pass of butterflies of four: x[q + stride (p + count j)] to y[q + stride (4p + j)]."""
    apart = stride * count
    for p in range(count):
        c1, s1 = cosines[p * unit], -sines[p * unit]
        c2, s2 = cosines[2 * p * unit], -sines[2 * p * unit]
        c3, s3 = cosines[3 * p * unit], -sines[3 * p * unit]
        x, y = stride * p, 4 * stride * p
        ar, ai = re[x : x + stride], im[x : x + stride]
        br, bi = re[x + apart : x + apart + stride], im[x + apart : x + apart + stride]
        cr, ci = re[x + 2 * apart : x + 2 * apart + stride], im[x + 2 * apart : x + 2 * apart + stride]
        dr, di = re[x + 3 * apart : x + 3 * apart + stride], im[x + 3 * apart : x + 3 * apart + stride]
        out_r, out_i = re2[y : y + 4 * stride], im2[y : y + 4 * stride]
        for q in range(stride):
            sum_r, sum_i = ar[q] + cr[q], ai[q] + ci[q]
            gap_r, gap_i = ar[q] - cr[q], ai[q] - ci[q]
            rest_r, rest_i = br[q] + dr[q], bi[q] + di[q]
            turn_r, turn_i = bi[q] - di[q], dr[q] - br[q]  # −i (b − d)
            out_r[q], out_i[q] = sum_r + rest_r, sum_i + rest_i
            r, i = gap_r + turn_r, gap_i + turn_i
            out_r[q + stride], out_i[q + stride] = r * c1 - i * s1, r * s1 + i * c1
            r, i = sum_r - rest_r, sum_i - rest_i
            out_r[q + 2 * stride], out_i[q + 2 * stride] = r * c2 - i * s2, r * s2 + i * c2
            r, i = gap_r - turn_r, gap_i - turn_i
            out_r[q + 3 * stride], out_i[q + 3 * stride] = r * c3 - i * s3, r * s3 + i * c3
