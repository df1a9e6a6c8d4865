"""Memory for the compiled convolver: an impulse response as spectra of its partitions, and the convolver's own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine import bounds
from engine.effects.responses import work_space
from engine.kernels import convolver as kernel
from engine.kernels import layout as at

LONGEST_S = 2 * bounds.LONGEST_IMPULSE_S  # a body's and a room's


def partitioned(impulse: NDArray[np.float64]) -> NDArray[np.float64]:
    """A response (frames, channels) as the kernel reads it."""
    frames, channels = impulse.shape
    memory = np.zeros(kernel.partitioned_slots(frames, channels))
    kernel.partition(work_space(2 * at.WINDOW), np.array(impulse), frames, memory)
    return memory


def convolver(rate_hz: int) -> NDArray[np.float64]:
    """The memory of a convolver for responses of up to `LONGEST_S`."""
    frames = round(LONGEST_S * rate_hz)
    memory = np.empty(kernel.convolver_slots(frames))
    memory[:] = 0.0  # written to, so that the device's thread finds every page in place
    kernel.begin(memory, float(rate_hz), frames)
    return memory
