"""The compiled inner loop of `splitting`: a scalar loop, one trajectory after the other.

Compiled rather than written in tensor operations because one stage of one string is about a hundred floating
point operations: the call of a tensor operation alone costs fifty times that.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz", "arcp"})
def advance(
    q: Array,
    v: Array,
    out: Array,
    flows: Array,
    kicks: Array,
    coupling: Array,
    eta_squared: Array,
    substeps: int,
) -> None:
    """Advances amplitudes q and velocities v (batch, modes) in place; writes out (batch, steps, modes).

    flows (stages, 4, modes): exact rotations; kicks (stages - 1,): lengths in s of the kicks between them.
    """
    batch, steps, modes = out.shape
    stages = flows.shape[0]
    for b in range(batch):
        qb, vb = q[b], v[b]
        for step in range(steps):
            for _ in range(substeps):
                stretch = 0.0
                for stage in range(stages):
                    kick = kicks[stage - 1] * stretch if stage > 0 else 0.0
                    flow = flows[stage]
                    qq, qv, vq, vv = flow[0], flow[1], flow[2], flow[3]
                    stretch = 0.0
                    for n in range(modes):
                        amplitude = qb[n]
                        velocity = vb[n] - kick * coupling[n] * amplitude
                        rotated = qq[n] * amplitude + qv[n] * velocity
                        qb[n] = rotated
                        vb[n] = vq[n] * amplitude + vv[n] * velocity
                        stretch += eta_squared[n] * rotated * rotated
            out[b, step] = qb
