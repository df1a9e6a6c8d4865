"""The effect of a body on a key's loudness: its gain at frequencies, for `engine.kernels.loudness`."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.effects import responses
from engine.effects.body import Body
from engine.kernels.constants import CURVES_HZ


@lru_cache(maxsize=16)
def curves_of(body: Body) -> NDArray[np.float64]:
    """The curves of the body alone, (BODY_SLOTS,), see `kernels.constants`: some hundredths of a second, once.

    The array is remembered, and not to be written.
    """
    curves = responses.curves_of(body.response(CURVES_HZ))
    curves.setflags(write=False)
    return curves
