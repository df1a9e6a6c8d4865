"""The compiled parts of a state-space block for rendering: the diagonal recurrence and what is pointwise."""

from __future__ import annotations

import numpy as np

from engine.kernels.compiled import HALF, ONE, kernel, tanh

_CUBIC, _ROOT = np.float32(0.044715), np.float32(np.sqrt(2 / np.pi))


@kernel
def stream(inputs: np.ndarray, eigenvalues: np.ndarray, state: np.ndarray) -> None:
    """x_k = λ x_{k-1} + v_k step by step in float64, in place.

    Args:
        inputs: v, overwritten by x: (steps, batch, 2, n), apart in real and imaginary parts, so that the loop becomes
            vector instructions.
        eigenvalues: λ, float64 (n, 2), real and imaginary parts.
        state: x before the first step, overwritten by the last x: float64 (batch, n, 2).
    """
    steps, batch, _, n = inputs.shape
    a, b = eigenvalues[:, 0].copy(), eigenvalues[:, 1].copy()
    for row in range(batch):
        re, im = state[row, :, 0].copy(), state[row, :, 1].copy()
        for k in range(steps):
            v, w = inputs[k, row, 0], inputs[k, row, 1]
            for i in range(n):
                p = a[i] * re[i] - b[i] * im[i] + v[i]
                q = a[i] * im[i] + b[i] * re[i] + w[i]
                re[i], im[i] = p, q
                v[i], w[i] = p, q
        state[row, :, 0] = re
        state[row, :, 1] = im


@kernel
def add_and_gelu(outputs: np.ndarray, frames: np.ndarray, scale: np.ndarray, shift: np.ndarray) -> None:
    """GELU(outputs + scale · frames + shift), in place in `outputs`; all float32, (rows, features) or (features,)."""
    rows, features = outputs.shape
    for r in range(rows):
        y, u = outputs[r], frames[r]
        for f in range(features):
            x = y[f] + scale[f] * u[f] + shift[f]
            y[f] = HALF * x * (ONE + tanh(_ROOT * x * (ONE + _CUBIC * x * x)))


@kernel
def add_gated(frames: np.ndarray, gates: np.ndarray) -> None:
    """Add the gated linear unit of `gates`, float32 (rows, 2 features), to `frames`, float32 (rows, features)."""
    rows, features = frames.shape
    for r in range(rows):
        y = frames[r]
        value = gates[r, :features]
        gate = gates[r, features:]
        for f in range(features):
            y[f] += value[f] * (HALF + HALF * tanh(HALF * gate[f]))
