"""The compiled recurrence of a diagonal state space layer, for rendering in short blocks."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def stream(inputs: np.ndarray, eigenvalues: np.ndarray, state: np.ndarray) -> None:
    """x_k = λ x_{k-1} + v_k step by step in float64, in place in `inputs` (steps, batch, n, 2) and `state`."""
    steps, batch, n, _ = inputs.shape
    for k in range(steps):
        for b in range(batch):
            for i in range(n):
                re = eigenvalues[i, 0] * state[b, i, 0] - eigenvalues[i, 1] * state[b, i, 1] + inputs[k, b, i, 0]
                im = eigenvalues[i, 0] * state[b, i, 1] + eigenvalues[i, 1] * state[b, i, 0] + inputs[k, b, i, 1]
                state[b, i, 0], state[b, i, 1] = re, im
                inputs[k, b, i, 0], inputs[k, b, i, 1] = re, im
