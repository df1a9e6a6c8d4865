"""A voice of the solved string: the splitting scheme of `engine.truth.splitting`, heard at two points."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.kernels import layout as at
from engine.kernels.compiled import COMPILED


@njit(**COMPILED)
def generate(voice: np.ndarray, program: np.ndarray, fading: bool, heard: bool, out: np.ndarray) -> None:
    """The next quantum, (4, QUANTUM); frame 0 is the string as it is let go.

    The highest modes are left out from when they are below the program's silence: sub-steps follow those left.
    """
    whole = program.view(np.int64)
    counts = voice.view(np.int64)
    n, stages = whole[at.T_MODES], whole[at.T_STAGES]
    rows = at.state(n)
    q, v = voice[rows : rows + n], voice[rows + n : rows + 2 * n]
    coupling, eta = program[whole[at.T_COUPLING] :], program[whole[at.T_ETA] :]
    inverse = program[whole[at.T_INVERSE] :]
    silence = program[at.T_SILENCE]
    moving = counts[at.MOVING]
    points = counts[at.POINTS]
    sets = 2 if fading else 1
    total = 0.0
    for frame in range(at.QUANTUM):
        if heard:
            for which in range(sets):
                for point in range(points):
                    slot = at.weights(n, which, point, 0)
                    w = voice[slot : slot + n]
                    found = 0.0
                    for m in range(moving):
                        found += w[m] * q[m]
                    out[2 * which + point, frame] = found
        if frame % 16 == 0:
            total = 0.0
            for m in range(moving):
                total += q[m] * q[m] + inverse[m] * v[m] * v[m]
            while moving > 1:
                m = moving - 1
                if not q[m] * q[m] + inverse[m] * v[m] * v[m] < silence * silence * total:
                    break
                q[m] = v[m] = 0.0
                moving = m
        level = whole[whole[at.T_LEVEL_OF] + moving - 1]
        for _ in range(whole[whole[at.T_SUBSTEPS] + level]):
            stretch = 0.0
            for stage in range(stages):
                kick = program[whole[at.T_KICKS] + level * stages + stage - 1] * stretch if stage > 0 else 0.0
                slot = whole[at.T_FLOWS] + (level * stages + stage) * 4 * n
                qq, qv = program[slot : slot + n], program[slot + n : slot + 2 * n]
                vq, vv = program[slot + 2 * n : slot + 3 * n], program[slot + 3 * n : slot + 4 * n]
                stretch = 0.0
                for m in range(moving):
                    amplitude = q[m]
                    speed = v[m] - kick * coupling[m] * amplitude
                    turned = qq[m] * amplitude + qv[m] * speed
                    q[m] = turned
                    v[m] = vq[m] * amplitude + vv[m] * speed
                    stretch += eta[m] * turned * turned
    counts[at.MOVING] = moving
    counts[at.GENERATED] += at.QUANTUM
    voice[at.LOUDNESS] = (0.5 * math.log(total) if total > 0 else -1e9) + program[at.T_LOUDNESS]
