"""The compiled recurrence of `fno`: one trajectory, step after step, in single precision.

Compiled rather than written in tensor operations because a step must take less than the 250 µs between two samples
at 4 kHz: the transforms of 2N points by FFT (2N = 202 = 2·101 has a large prime factor); the complex product and
some fifteen calls take ten times that. Nothing is allocated after the start, and the interpreter is free for others.

Three things make it fast.

- Small transforms: two real matrix products (BLAS) of half the length (`_fno_transform`).
- Contiguous weights. The product reads every weight once a step (2.5 MB at the paper's sizes, more than the nearest
  caches hold), in order; that reading is the floor.
- A rational tanh that the compiler turns into vector instructions.

Arrays are float32: a field (points, width), a spectrum (2, frequencies, width) with the real parts first. As many
frequencies as points; widths are even.
"""

from __future__ import annotations

import numpy as np

from engine.kernels.compiled import HALF, ZERO, kernel, tanh
from engine.models._fno_transform import Array, Pair


@kernel
def advance_fgru(
    hidden: Array,
    frames: Array,
    transforms: Pair,
    convolutions: Pair,
    out: Pair,
) -> None:
    """Advance an FGRU's `hidden` (points, width) in place, by a step for each of the frames that it writes.

    Args:
        frames: written: displacement after each step, (steps, points).
        transforms: the folded transform and its inverse, as `transform_matrices` gives them.
        convolutions: weights (3, frequencies, width in, 2, width out) of z, r and the candidate, and their biases as
            fields, (3, points, width).
        out: weights (1, width, 1) and bias (1, 1) of the map to displacement.
    """
    points, width = hidden.shape
    forward, inverse = transforms
    weights, biases = convolutions
    spectrum = np.empty((2, points, width), np.float32)
    folded = np.empty((2, points // 2 + 1, width), np.float32)
    product = np.empty_like(spectrum)
    z = np.empty_like(hidden)
    r = np.empty_like(hidden)
    candidate = np.empty_like(hidden)
    for step in range(frames.shape[0]):
        _analyse(hidden, forward, folded, spectrum)
        _convolve(spectrum, weights[0], biases[0], inverse, product, folded, z)
        _convolve(spectrum, weights[1], biases[1], inverse, product, folded, r)
        for t in range(points):
            for w in range(width):
                r[t, w] = (HALF + HALF * tanh(HALF * r[t, w])) * hidden[t, w]
        _analyse(r, forward, folded, spectrum)
        _convolve(spectrum, weights[2], biases[2], inverse, product, folded, candidate)
        for t in range(points):
            for w in range(width):
                gate = HALF + HALF * tanh(HALF * z[t, w])
                hidden[t, w] += gate * (tanh(candidate[t, w]) - hidden[t, w])
        _read(hidden, out, frames[step])


@kernel
def advance_frnn(
    hidden: Array,
    frames: Array,
    transforms: Pair,
    convolutions: Pair,
    pointwise: Pair,
    out: Pair,
) -> None:
    """Advance an FRNN, as `advance_fgru`, with `depth` convolutions and pointwise layers.

    Their weights are (depth, width in, width out), their biases (depth, width).
    """
    points, width = hidden.shape
    forward, inverse = transforms
    weights, biases = convolutions
    pointwise_weights, pointwise_biases = pointwise
    spectrum = np.empty((2, points, width), np.float32)
    folded = np.empty((2, points // 2 + 1, width), np.float32)
    product = np.empty_like(spectrum)
    branch = np.empty_like(hidden)
    straight = np.empty_like(hidden)
    for step in range(frames.shape[0]):
        for layer in range(weights.shape[0]):
            _analyse(hidden, forward, folded, spectrum)
            _convolve(spectrum, weights[layer], biases[layer], inverse, product, folded, branch)
            np.dot(hidden, pointwise_weights[layer], straight)
            bias = pointwise_biases[layer]
            for t in range(points):
                for w in range(width):
                    value = branch[t, w]
                    positive = ZERO if value < ZERO else value  # in this order NaN is kept
                    hidden[t, w] = positive + straight[t, w] + bias[w]
        _read(hidden, out, frames[step])


@kernel
def _analyse(field: Array, forward: Array, folded: Array, spectrum: Array) -> None:
    """Write the spectrum (2, frequencies, width) of a field (points, width), by its symmetric and antisymmetric half.

    Args:
        forward: the folded transform, (2, frequencies, half) with half = points // 2 + 1.
        folded: work space, (2, half, width).
    """
    points, width = field.shape
    folded[:] = field[: points // 2 + 1]
    for t in range(1, (points + 1) // 2):  # the first point and a middle one stand alone
        for w in range(width):
            folded[0, t, w] += field[points - t, w]
            folded[1, t, w] -= field[points - t, w]
    np.dot(forward[0], folded[0], spectrum[0])
    np.dot(forward[1], folded[1], spectrum[1])


@kernel
def _convolve(
    spectrum: Array, weights: Array, bias: Array, inverse: Array, product: Array, folded: Array, field: Array
) -> None:
    """Write the field (points, width) whose spectrum is weights × spectrum, plus the bias, which is already a field.

    Args:
        weights: (frequencies, width in, 2, width out).
        inverse: the inverse of the folded transform, (2, half, frequencies).
        product, folded: work space, as a spectrum (2, frequencies, width) and (2, half, width).
    """
    points, width = field.shape
    for k in range(points):
        re, im = product[0, k], product[1, k]
        re[:] = 0
        im[:] = 0
        for i in range(0, width, 2):  # two at a time halve the traffic of the sums
            a, b = spectrum[0, k, i], spectrum[1, k, i]
            c, d = spectrum[0, k, i + 1], spectrum[1, k, i + 1]
            p, q = weights[k, i, 0], weights[k, i, 1]
            u, v = weights[k, i + 1, 0], weights[k, i + 1, 1]
            for o in range(width):
                re[o] += a * p[o] - b * q[o] + c * u[o] - d * v[o]
                im[o] += a * q[o] + b * p[o] + c * v[o] + d * u[o]
    np.dot(inverse[0], product[0], folded[0])
    np.dot(inverse[1], product[1], folded[1])
    for t in range(folded.shape[1]):
        for w in range(width):
            field[t, w] = bias[t, w] + folded[0, t, w] + folded[1, t, w]
    for t in range(1, (points + 1) // 2):
        for w in range(width):
            field[points - t, w] = bias[points - t, w] + folded[0, t, w] - folded[1, t, w]


@kernel
def _read(hidden: Array, out: Pair, frame: Array) -> None:
    """Write the displacement of every point to `frame` (points,); `out` as in `advance_fgru`."""
    weights, biases = out
    for t in range(hidden.shape[0]):
        total = biases[0, 0]
        for w in range(hidden.shape[1]):
            total += hidden[t, w] * weights[0, w, 0]
        frame[t] = total
