"""A body as plug-ins have it: the record `engine.kernels.records.BODY` with its modes or samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine import bounds
from engine.effects.body import Body, modes_of, subsonic_hz
from engine.effects.body_table import BODIES
from engine.kernels.records import BODY, slots

LARGEST_WHOLE = 2**31 - 1  # of a sample


def body_memory(body: Body | None) -> NDArray[np.float64]:
    """A body at a size of 1; all 0 where there is none."""
    memory, rows = np.zeros(slots(BODY)), np.zeros(0)
    record = memory.view(BODY)[0]
    record["longest_s"] = bounds.LONGEST_IMPULSE_S
    if body is not None and body.impulse is not None:
        samples = body.impulse.samples
        unit = float(np.abs(samples).max()) / LARGEST_WHOLE  # where it is loud, finer than single precision
        record["frames"], record["channels"] = samples.shape
        record["hz"], record["unit"] = body.impulse.rate_hz, unit
        whole = np.zeros(2 * -(-samples.size // 2), np.int32)
        whole[: samples.size] = np.rint(samples / unit).ravel()
        rows = whole.view(np.float64)
    elif body is not None:
        wood = BODIES[body.name]
        rows = modes_of(wood).ravel()
        record["modes"] = rows.size // 4
        record["seconds"] = wood.seconds
        record["subsonic_hz"] = subsonic_hz(wood)
    return np.concatenate([memory, rows])
