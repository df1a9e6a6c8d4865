"""The effect of a body on a key's loudness: its gain at frequencies, for `engine.kernels.loudness`."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.effects.body import Body
from engine.effects.impulse import noise_powers, room_for
from engine.kernels import constants as of

RATE_HZ = 48_000  # of the response; keys are as loud at other rates
FINEST_HZ = 0.75  # of the spectrum


@lru_cache(maxsize=16)
def curves_of(body: Body) -> NDArray[np.float64]:
    """The curves of the body alone, (BODY_SLOTS,), see `kernels.constants`: some hundredths of a second, once.

    Each value is the mean of the spectrum half-way to its neighbours. The array is remembered, and not to be written.
    """
    response = body.response(RATE_HZ)
    size = room_for(max(len(response), round(RATE_HZ / FINEST_HZ)))
    spectrum, hz = np.fft.rfft(response, size, axis=0), np.fft.rfftfreq(size, 1 / RATE_HZ)
    rows = np.stack([spectrum.real.mean(1), spectrum.imag.mean(1), (np.abs(spectrum) ** 2).mean(1)])
    edges_hz = of.BODY_LOWEST_HZ * 2 ** ((np.arange(of.BODY_POINTS + 1) - 0.5) / of.BODY_STEPS)
    found, strings_alone = np.zeros(of.BODY_SLOTS), np.ones((1, 1))
    found[of.BODY_CROSS] = noise_powers((strings_alone, response), RATE_HZ)[0, 1]
    found[of.BODY_STEP] = np.abs(np.cumsum(response, axis=0)).max()
    for row, values in enumerate(rows):
        areas = np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) / 2)]) * hz[1]
        first = of.BODY_HEADER + row * of.BODY_POINTS
        found[first : first + of.BODY_POINTS] = np.diff(np.interp(edges_hz, hz, areas)) / np.diff(edges_hz)
    found.setflags(write=False)
    return found
