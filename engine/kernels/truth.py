"""A voice of the solved string: the splitting scheme of `engine.truth.splitting`, heard at two points.

Its modes are its own and may change while it rings; the flows between two kicks follow from them.
"""

from __future__ import annotations

import math

import numpy as np

from engine.kernels import voice_records as at
from engine.kernels.compiled import kernel
from engine.kernels.constants import QUANTUM
from engine.kernels.modes import damped, glide, gliding, motion, rest_above, rest_silent, row, table, turn, weights
from engine.kernels.rotation import rotation


@kernel
def _sub_steps(voice: at.Voice, program: at.TruthProgram) -> int:
    """The number of sub-steps of a frame: `program.substeps` in a period of the highest mode that moves.

    A string that may touch its bridge's edge (`engine.kernels.javari`) takes a multiple of `javari.steps`: so many
    times a frame the contact's force is computed. What is linear needs no others; 0: none at all.
    """
    n = voice.modes
    squares, couplings = row(voice, at.OMEGA_SQUARED), row(voice, at.COUPLING)
    steps = voice.javari.steps
    if couplings[n - 1] == 0.0:  # linear: the tension moves all modes or none
        return steps
    highest = math.sqrt(squares[voice.moving - 1])
    count = max(1, math.ceil(program.substeps * highest / (2 * math.pi * program.rate_hz)))
    return count if steps == 0 else (count + steps - 1) // steps * steps


@kernel
def _prepare(voice: at.Voice, program: at.TruthProgram, sub_steps: int) -> None:
    """Compute the exact damped rotations between kicks, of half the palindrome: four rows (modes,) for each stage.

    With no sub-steps, 0, they are one rotation over a whole frame.
    """
    n = voice.modes
    squares, sigmas = row(voice, at.OMEGA_SQUARED), row(voice, at.SIGMA)
    for stage in range(at.STAGES // 2 if sub_steps else 1):
        time_s = (program.rotations[stage] / sub_steps if sub_steps else 1.0) / program.rate_hz
        first = at.FOLLOWING + 4 * stage
        qq, qv = row(voice, first), row(voice, first + 1)
        vq, vv = row(voice, first + 2), row(voice, first + 3)
        for m in range(n):
            qq[m], qv[m], vq[m], vv[m] = rotation(sigmas[m], damped(squares[m], sigmas[m]), time_s)
    voice.steps = sub_steps
    voice.prepared = 1
    voice.javari.give = 0.0


@kernel
def set_up(voice: at.Voice, program: at.TruthProgram) -> int:
    """Bring what follows from a voice's modes up to date for a quantum; return its sub-steps of a frame.

    They are 0 where it is linear and has no javari.
    """
    changed = gliding(voice)
    if changed:
        glide(voice)
        rest_above(voice, program.rate_hz)
    sub_steps = _sub_steps(voice, program)
    if changed or not voice.prepared or sub_steps != voice.steps:
        _prepare(voice, program, sub_steps)
    return sub_steps


@kernel
def hear(voice: at.Voice, program: at.TruthProgram, frame: int, fading: bool, audible: bool, out: np.ndarray) -> None:
    """Write a frame of the output, (4, QUANTUM), before the motion advances; every 16 frames look at the loudness.

    The highest modes are left out from when they are below the program's silence: sub-steps follow those left. On a
    string with a javari, whose contact may wake them, none are left out.
    """
    q, v = motion(voice)
    squares = row(voice, at.OMEGA_SQUARED)
    silence = program.silence if voice.javari.steps == 0 else 0.0
    moving = voice.moving
    if audible:
        for which in range(2 if fading else 1):
            for point in range(voice.points):
                w, displacement = weights(voice, which, point, 0), 0.0
                for m in range(moving):
                    displacement += w[m] * q[m]
                out[2 * which + point, frame] = displacement
    if frame % 16 == 0:
        voice.moving, total = rest_silent(q, v, squares, moving, silence)
        voice.loudness = (0.5 * math.log(total) if total > 0 else -1e9) + program.loudness


@kernel
def ring(voice: at.Voice, program: at.TruthProgram, sub_steps: int, count: int) -> None:
    """Advance a voice by `count` of a frame's sub-steps; where these are 0, as it is linear, by whole frames."""
    moving = voice.moving
    q, v = motion(voice)
    couplings, stretches = row(voice, at.COUPLING), row(voice, at.STRETCH)
    step_s = 1 / (max(sub_steps, 1) * program.rate_hz)
    for _ in range(count):
        stretch = 0.0
        for stage in range(at.STAGES if sub_steps else 1):
            kick = program.kicks[stage - 1] * step_s * stretch if stage > 0 else 0.0
            first = at.FOLLOWING + 4 * min(stage, at.STAGES - 1 - stage)
            stretch = turn(q, v, moving, table(voice, first, 4), kick, couplings, stretches)


@kernel
def generate(voice: at.Voice, program: at.TruthProgram, fading: bool, audible: bool, out: np.ndarray) -> None:
    """Write the next quantum, (4, QUANTUM); frame 0 is the string at its release.

    Row 2 s + p is of the set s of weights at the point p; the second set is heard where `fading` to it.
    """
    sub_steps = set_up(voice, program)
    for frame in range(QUANTUM):
        hear(voice, program, frame, fading, audible, out)
        ring(voice, program, sub_steps, max(sub_steps, 1))
    voice.generated += QUANTUM
