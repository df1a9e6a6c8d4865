"""The compiled inner loop of `splitting`: a scalar loop, one trajectory after the other.

Compiled rather than written in tensor operations because one stage of one string is about a hundred floating
point operations: the call of a tensor operation alone costs fifty times that.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.kernels.compiled import kernel
from engine.kernels.modes import rest_silent, turn

Array = NDArray[np.float64]


@kernel
def advance(
    q: Array,
    v: Array,
    steps: int,
    frames: NDArray[np.int64],
    out: Array,
    flows: Array,
    kicks: Array,
    coupling: Array,
    eta_squared: Array,
    substeps: NDArray[np.int64],
    levels: NDArray[np.int64],
    omega_squared: Array,
    silence: float,
) -> None:
    """Advance amplitudes q and velocities v (batch, modes) in place by `steps` samples.

    Writes out (batch, frames, modes), the amplitudes after as many samples as `frames` (frames,) say, ascending.
    flows (levels, stages, 4, modes): exact rotations; kicks (levels, stages - 1): lengths in s of the kicks between
    them; substeps (levels,) per sample. As long as the lowest n modes move, all is done at levels[n - 1]. Before each
    sample the highest that moves is laid to rest where its amplitude is below `silence` of that of all together.
    """
    batch, modes = q.shape
    kept = len(frames)
    stages = flows.shape[1]
    for b in range(batch):
        qb, vb = q[b], v[b]
        moving = modes
        written = 0
        for step in range(steps):
            if silence > 0:
                moving, _ = rest_silent(qb, vb, omega_squared, moving, silence)
            level = levels[moving - 1]
            for _ in range(substeps[level]):
                stretch = 0.0
                for stage in range(stages):
                    kick = kicks[level, stage - 1] * stretch if stage > 0 else 0.0
                    stretch = turn(qb, vb, moving, flows[level, stage], kick, coupling, eta_squared)
            if written < kept and frames[written] == step + 1:
                out[b, written] = qb
                written += 1
