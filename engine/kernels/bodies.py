"""The impulse response of a body, from its modes or from a response that is given, at any size and rate."""

from __future__ import annotations

import math

import numpy as np

from engine.kernels import constants as of
from engine.kernels.compiled import kernel
from engine.kernels.fourier import ONE, SPARE, row, silence
from engine.kernels.memory import part
from engine.kernels.responses import fade, high_pass, level, resample, resampled_frames

RUN = 128  # frames in which a mode is computed from the frame before
HIGHEST_SHARE = 0.45  # of the rate: no mode lies above
HZ, DECAY, LEFT, RIGHT = range(4)  # rows of modes, at a size of 1


@kernel
def rung_frames(seconds: float, size: float, rate_hz: float) -> int:
    """The length of the response of a body whose modes ring so long at a size of 1."""
    return RUN * math.ceil(seconds * size * rate_hz / RUN)


@kernel
def given_frames(frames: int, own_hz: float, size: float, rate_hz: float, longest_s: float) -> int:
    """The length of a response that is given, whose rate at a size of 1 is `own_hz`; what is longer is cut."""
    return min(resampled_frames(frames, own_hz / size, rate_hz), int(longest_s * rate_hz))


@kernel
def ring(work: np.ndarray, modes: np.ndarray, size: float, rate_hz: float, sound: np.ndarray) -> None:
    """Write the sound (frames, 2) of all modes, (4, modes), after one blow, in whole runs of RUN frames.

    The runs are computed side by side. `size`: a factor of the body's lengths; its modes are lower by it.
    """
    runs, step_s = len(sound) // RUN, 1 / rate_hz
    x, y = row(work, ONE, runs), row(work, ONE + 1, runs)
    left, right = row(work, SPARE, RUN * runs), row(work, SPARE + 1, RUN * runs)  # frames of all runs, then the next
    silence(work, SPARE, 0, RUN * runs)
    highest_hz = min(of.BODY_HIGHEST_HZ, HIGHEST_SHARE * rate_hz)
    for mode in range(modes.shape[1]):
        hz, sigma = modes[HZ, mode] / size, modes[DECAY, mode] / size
        if hz >= highest_hz:
            continue
        omega, fall = 2 * math.pi * hz, math.exp(-sigma * step_s)
        cosine, sine = fall * math.cos(omega * step_s), fall * math.sin(omega * step_s)
        for run in range(runs):
            time_s = run * RUN * step_s
            swing = math.exp(-sigma * time_s)
            x[run], y[run] = swing * math.cos(omega * time_s), swing * math.sin(omega * time_s)
        to_left, to_right = modes[LEFT, mode] / size, modes[RIGHT, mode] / size
        for frame in range(RUN):
            frame_left, frame_right = part(left, frame * runs, runs), part(right, frame * runs, runs)
            for run in range(runs):
                before = x[run]
                frame_left[run] += to_left * y[run]
                frame_right[run] += to_right * y[run]
                x[run] = cosine * before - sine * y[run]
                y[run] = sine * before + cosine * y[run]
    for run in range(runs):
        for frame in range(RUN):
            sound[run * RUN + frame, 0] = left[frame * runs + run]
            sound[run * RUN + frame, 1] = right[frame * runs + run]


@kernel
def respond(
    work: np.ndarray, modes: np.ndarray, subsonic_hz: float, size: float, rate_hz: float, sound: np.ndarray
) -> None:
    """Write the response of a body that has modes.

    Args:
        subsonic_hz: below it the body radiates next to nothing, at a size of 1.
        sound: (`rung_frames`, 2).
    """
    ring(work, modes, size, rate_hz, sound)
    high_pass(work, sound, subsonic_hz / size, rate_hz)
    fade(sound)
    level(work, sound, rate_hz)


@kernel
def respond_as(
    work: np.ndarray, recorded: np.ndarray, own_hz: float, size: float, rate_hz: float, sound: np.ndarray
) -> None:
    """Write the response, (`given_frames`, 2), of a body that is given as one."""
    resample(work, recorded, own_hz / size, rate_hz, sound)
    if len(sound) < resampled_frames(len(recorded), own_hz / size, rate_hz):
        fade(sound)
    level(work, sound, rate_hz)
