"""The means that compiled kernels share: compiler options, the cache's place, plain laws, a tanh for vectors."""

from __future__ import annotations

from types import FunctionType
from typing import Any

import numpy as np
from numba import config, njit
from numba.extending import register_jitable

from engine.kernels import cache, pulses, recorded, rotation, strings, velocities
from engine.kernels.numba_internals import (
    compile_for_callers_alone,
    keep_cache_when_moved,
    keep_machine_code_alone,
)

PLACE = cache.folder()
config.CACHE_DIR = str(PLACE or "")

# Fast mathematics without "nnan" and "ninf": a model that blows up shall be seen to. NumPy's errors: Python's test of
# every divisor keeps loops from becoming vector instructions.
COMPILED: dict[str, Any] = {
    "cache": PLACE is not None,
    "nogil": True,
    "fastmath": {"reassoc", "contract", "nsz", "arcp"},
    "error_model": "numpy",
}


def kernel(function: Any) -> Any:
    """Compile a function where it is first called."""
    return njit(**COMPILED)(function)


def inlined(function: Any) -> Any:
    """Compile a function into those that call it."""
    return njit(inline="always", **COMPILED)(function)


LAWS = pulses, recorded, rotation, strings, velocities  # modules of plain functions that compiled ones call


compile_for_callers_alone()
keep_machine_code_alone()
keep_cache_when_moved()
for _laws in LAWS:
    for _law in vars(_laws).values():
        if isinstance(_law, FunctionType) and _law.__module__ == _laws.__name__:
            register_jitable(error_model="numpy")(_law)

# A number in the source would be a double and take the whole expression with it.
ZERO, HALF, ONE, _TWO, _LARGE = (np.float32(x) for x in (0, 0.5, 1, 2, 9))
_P0, _P1, _P2 = (np.float32(x) for x in (135135, 17325, 378))
_Q0, _Q1, _Q2, _Q3 = (np.float32(x) for x in (135135, 62370, 3150, 28))


@kernel
def tanh(x: np.float32) -> np.float32:
    """tanh x to 1.3e-7: Lambert's continued fraction of tanh(x/2) to depth 7, then tanh 2y = 2 tanh y/(1 + tanh² y).

    Beyond ±9 it is ±1 in single precision.
    """
    y = HALF * (-_LARGE if x < -_LARGE else _LARGE if x > _LARGE else x)  # in this order NaN is kept
    s = y * y
    t = y * (_P0 + s * (_P1 + s * (_P2 + s))) / (_Q0 + s * (_Q1 + s * (_Q2 + _Q3 * s)))
    return _TWO * t / (ONE + t * t)
