"""Memory for the compiled convolver: an impulse response as spectra of its partitions, and the convolver's own."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from engine import bounds
from engine.kernels.constants import QUANTUM
from engine.kernels.fields import record_of, slots
from engine.kernels.mixer_records import CONVOLVER, EARLY, IMPULSE, WINDOW

FADE_S = 0.020  # at least: the way from one response to another, in whole windows
LONGEST_S = 2 * bounds.LONGEST_IMPULSE_S  # a body's and a room's


def partitioned(impulse: NDArray[np.float64]) -> NDArray[np.float64]:
    """A response (frames, channels) as the kernel reads it; the inverse transform's factor is in it."""
    channels = impulse.shape[1]
    early = _spectra(impulse[: EARLY * QUANTUM], QUANTUM)
    late = _spectra(impulse[EARLY * QUANTUM :], WINDOW)
    memory = np.concatenate([np.zeros(slots(IMPULSE)), early.ravel(), late.ravel()])
    record = record_of(memory, IMPULSE)
    record["channels"], record["early"], record["late"] = channels, len(early), len(late)
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
    capacity = math.ceil(LONGEST_S * rate_hz / WINDOW)
    memory = np.empty(slots(CONVOLVER) + capacity * 4 * (WINDOW + 1))
    memory[:] = 0.0  # written to, so that the device's thread finds every page in place
    record = record_of(memory, CONVOLVER)
    record["capacity"], record["step"] = capacity, -1
    record["fade_windows"] = math.ceil(FADE_S * rate_hz / WINDOW)
    turns = 2 * np.pi * np.arange(2 * WINDOW) / (2 * WINDOW)
    record["cosines"], record["sines"] = np.cos(turns), np.sin(turns)
    return memory
