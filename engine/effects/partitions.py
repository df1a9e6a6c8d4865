"""Memory for the compiled convolver: an impulse response as spectra of its partitions, and the convolver's own."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from engine import bounds
from engine.kernels import layout as at

FADE_S = 0.020  # at least: the way from one response to another, in whole windows
LONGEST_S = 2 * bounds.LONGEST_IMPULSE_S  # a body's and a room's


def partitioned(impulse: NDArray[np.float64]) -> NDArray[np.float64]:
    """A response (frames, channels) as the kernel reads it; the inverse transform's factor is in it."""
    channels = impulse.shape[1]
    early = _spectra(impulse[: at.EARLY * at.QUANTUM], at.QUANTUM)
    late = _spectra(impulse[at.EARLY * at.QUANTUM :], at.WINDOW)
    memory = np.zeros(at.I_HEADER + early.size + late.size)
    memory.view(np.int64)[[at.I_CHANNELS, at.I_EARLY, at.I_LATE]] = channels, len(early), len(late)
    memory[at.I_HEADER :] = np.concatenate([early.ravel(), late.ravel()])
    return memory


def _spectra(part: NDArray[np.float64], frames: int) -> NDArray[np.float64]:
    """(partitions, channels, 2, frames + 1)."""
    count, channels = math.ceil(len(part) / frames), part.shape[1]
    padded = np.zeros((count * frames, channels))
    padded[: len(part)] = part
    blocks = padded.reshape(count, frames, channels).transpose(0, 2, 1)
    spectra = np.fft.rfft(blocks, 2 * frames) / (2 * frames)
    return np.stack([spectra.real, spectra.imag], 2)


def convolver(rate_hz: int) -> NDArray[np.float64]:
    """The memory of a convolver for responses of up to `LONGEST_S`."""
    capacity = math.ceil(LONGEST_S * rate_hz / at.WINDOW)
    memory = np.empty(at.C_LATE + capacity * 4 * (at.WINDOW + 1))
    memory[:] = 0.0  # written to, so that the device's thread finds every page in place
    whole = memory.view(np.int64)
    whole[at.C_CAPACITY] = capacity
    whole[at.C_FADE_WINDOWS] = math.ceil(FADE_S * rate_hz / at.WINDOW)
    whole[at.C_STEP] = -1
    turns = 2 * np.pi * np.arange(2 * at.WINDOW) / (2 * at.WINDOW)
    memory[at.C_COSINES : at.C_SINES] = np.cos(turns)
    memory[at.C_SINES : at.C_EARLY_INPUT] = np.sin(turns)
    return memory
