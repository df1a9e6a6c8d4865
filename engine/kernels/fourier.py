"""Complex Fourier transforms that need no memory of their own.

Stockham's self-sorting form with factors of four and one of two: C. Van Loan, "Computational Frameworks for the Fast
Fourier Transform", SIAM 1992, section 1.7. Libraries that Numba can call (rocket-fft) make a new array with each
call and look their plan up behind a lock. The device's thread must do neither. Other lengths are convolutions of
a power of two with a chirp (L. Bluestein, IEEE Trans. Audio Electroacoust. 18 (1970) 451).
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from engine.kernels.compiled import kernel
from engine.kernels.memory import part

# Rows of a work space, (ROWS, N), N a power of two: a circle, room for transforms, two signals of complex numbers
COSINES = 0
SINES = 1
SPARE = 2
ONE = 4
TWO = 6
ROWS = 8
Complex: TypeAlias = tuple[np.ndarray, np.ndarray]  # real and imaginary parts
RUN = 16  # numbers of a chirp that are computed one from the other


@kernel
def transform(
    re: np.ndarray, im: np.ndarray, re2: np.ndarray, im2: np.ndarray, cosines: np.ndarray, sines: np.ndarray
) -> None:
    """Replace re + i·im, of n numbers, a power of two, by Σ (re + i·im)[t] exp(−2πi kt/n).

    With real and imaginary parts exchanged in the call it is the inverse, times n.

    Args:
        re2, im2: as much room again.
        cosines, sines: of 2πk/N for k = 0 … N − 1, N being a multiple of n.
    """
    n = len(re)
    unit = len(cosines) // n
    left = n
    stride = 1
    exchanged = False
    while left > 1:
        if left % 4 == 0:
            _fours((re, im), (re2, im2), (cosines, sines), left // 4, stride, unit * stride)
            left, stride = left // 4, stride * 4
        else:
            for q in range(stride):
                re2[q], im2[q] = re[q] + re[q + stride], im[q] + im[q + stride]
                re2[q + stride], im2[q + stride] = re[q] - re[q + stride], im[q] - im[q + stride]
            left, stride = left // 2, stride * 2
        re, im, re2, im2 = re2, im2, re, im
        exchanged = not exchanged
    if exchanged:
        for k in range(n):
            re2[k], im2[k] = re[k], im[k]


@kernel
def _fours(source: Complex, target: Complex, circle: Complex, count: int, stride: int, unit: int) -> None:
    """Compute one pass of butterflies of four: x[q + stride (p + count j)] to y[q + stride (4p + j)].

    Real and imaginary parts are arrays by themselves, so that a processor takes several numbers at once.
    """
    (re, im), (re2, im2), (cosines, sines) = source, target, circle
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


@kernel
def power_of_two(least: int) -> int:
    """The smallest power of two that is not below a number."""
    power = 1
    while power < least:
        power *= 2
    return power


@kernel
def fill_circle(cosines: np.ndarray, sines: np.ndarray) -> None:
    """Write cosines and sines of 2πk/N, k = 0 … N − 1; N is a multiple of 4."""
    quarter = len(cosines) // 4
    for k in range(quarter):
        cosine, sine = math.cos(2 * math.pi * k / len(cosines)), math.sin(2 * math.pi * k / len(cosines))
        cosines[k], sines[k] = cosine, sine
        cosines[quarter + k], sines[quarter + k] = -sine, cosine
        cosines[2 * quarter + k], sines[2 * quarter + k] = -cosine, -sine
        cosines[3 * quarter + k], sines[3 * quarter + k] = sine, -cosine


@kernel
def row(work: np.ndarray, number: int, size: int) -> np.ndarray:
    """The first numbers of a row of a work space."""
    return part(work[number], 0, size)


@kernel
def silence(work: np.ndarray, signal: int, first: int, end: int) -> None:
    """Set a signal of a work space, its rows `signal` and `signal + 1`, to 0 from the place `first` to `end`."""
    re, im = row(work, signal, end), row(work, signal + 1, end)
    for k in range(first, end):
        re[k] = im[k] = 0.0


@kernel
def turn(work: np.ndarray, real: int, imaginary: int, size: int) -> None:
    """Transform a signal of a work space, given its rows, in place; its size is a power of two.

    With its rows exchanged it is the inverse, times the size.
    """
    re = row(work, real, size)
    im = row(work, imaginary, size)
    spare = row(work, SPARE, size)
    transform(re, im, spare, row(work, SPARE + 1, size), work[COSINES], work[SINES])


@kernel
def turn_any(work: np.ndarray, period: int, count: int, wanted: int, behind: int, size: int) -> None:
    """Transform signal ONE in place at multiples of 1/period, as its convolution with a chirp; TWO is used.

    Places count modulo `size`, a power of two that is not below the number of all that is given and wanted.

    Args:
        period: in places: frequencies are the multiples of 1/period.
        count: places from 0 on that may hold something; the others are negative.
        wanted: places from 0 on that are wanted; the others are negative.
        behind: the longest way from a place that is given down to one that is wanted.
    """
    _fill_chirp(work, period, count, size)
    _turn_back(work, size)
    _fill_chirp(work, period, size - behind, size)
    re, im = row(work, ONE, size), row(work, ONE + 1, size)
    chirp_re, chirp_im = row(work, TWO, size), row(work, TWO + 1, size)
    turn(work, ONE, ONE + 1, size)
    turn(work, TWO, TWO + 1, size)
    for k in range(size):
        real, imaginary = re[k] / size, im[k] / size
        re[k] = real * chirp_re[k] - imaginary * chirp_im[k]
        im[k] = real * chirp_im[k] + imaginary * chirp_re[k]
    turn(work, ONE + 1, ONE, size)
    _fill_chirp(work, period, wanted, size)
    _turn_back(work, size)


@kernel
def _fill_chirp(work: np.ndarray, period: int, positive: int, size: int) -> None:
    """Write exp(πi k²/period) as signal TWO, from k = 0 on as many as `positive`, then negative k."""
    re, im = row(work, TWO, size), row(work, TWO + 1, size)
    angle = math.pi / period
    real = imaginary = step_re = step_im = 0.0
    further_re, further_im = math.cos(2 * angle), math.sin(2 * angle)
    for k in range(max(positive, size - positive + 1)):
        if k % RUN == 0:
            real, imaginary = math.cos(angle * (k * k % (2 * period))), math.sin(angle * (k * k % (2 * period)))
            step = angle * ((2 * k + 1) % (2 * period))
            step_re, step_im = math.cos(step), math.sin(step)
        if k < positive:
            re[k], im[k] = real, imaginary
        if 0 < k <= size - positive:
            re[size - k], im[size - k] = real, imaginary
        real, imaginary = real * step_re - imaginary * step_im, real * step_im + imaginary * step_re
        step_re, step_im = step_re * further_re - step_im * further_im, step_re * further_im + step_im * further_re


@kernel
def _turn_back(work: np.ndarray, size: int) -> None:
    """Multiply signal ONE by the conjugate of TWO."""
    re, im = row(work, ONE, size), row(work, ONE + 1, size)
    chirp_re, chirp_im = row(work, TWO, size), row(work, TWO + 1, size)
    for k in range(size):
        re[k], im[k] = re[k] * chirp_re[k] + im[k] * chirp_im[k], im[k] * chirp_re[k] - re[k] * chirp_im[k]
