"""Memory for the compiled convolver: an impulse response as spectra of its partitions, and the convolver's own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine import bounds
from engine.effects.responses import work_space
from engine.kernels import convolver as kernel
from engine.kernels.fields import record_of
from engine.kernels.mixer_records import CONVOLVER, IMPULSE, WINDOW

LONGEST_S = 2 * bounds.LONGEST_IMPULSE_S  # a body's and a room's


def partitioned(impulse: NDArray[np.float64]) -> NDArray[np.float64]:
    """A response (frames, channels) as the kernel reads it."""
    frames, channels = impulse.shape
    memory = np.zeros(kernel.partitioned_slots(frames, channels))
    kernel.partition(work_space(2 * WINDOW), np.array(impulse), frames, record_of(memory, IMPULSE))
    return memory


def convolver(rate_hz: int) -> NDArray[np.float64]:
    """The memory of a convolver for responses of up to `LONGEST_S`."""
    frames = round(LONGEST_S * rate_hz)
    memory = np.empty(kernel.convolver_slots(frames))
    memory[:] = 0.0  # written to, so that the device's thread finds every page in place
    kernel.begin(record_of(memory, CONVOLVER), float(rate_hz), frames)
    return memory
