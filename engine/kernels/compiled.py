"""What the compiled kernels share: how they are compiled, where that is kept, and a tanh for vector instructions."""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numba import config, njit


def _sources() -> list[Path]:
    """Of all compiled functions, which call one another across files."""
    engine = Path(__file__).parents[1]
    kernels = [*(engine / "models").glob("_*kernel.py"), *(engine / "reference").glob("_*kernel.py")]
    return sorted([*(engine / "kernels").glob("*.py"), *kernels])


def _cache_folder() -> Path:
    """A folder for these very sources: beside them, else in the home folder, else a temporary one.

    Numba notices that a function's own file has changed, but not a file that it calls into. With one folder a version
    nothing compiled for another memory layout is ever loaded.
    """
    digest = hashlib.sha256()
    for source in _sources():
        digest.update(source.read_bytes())
    name = f"kernels-{digest.hexdigest()[:16]}"
    for place in (Path(__file__).parent / "__pycache__", Path("~/.cache/learned-strings").expanduser()):
        try:
            (place / name).mkdir(parents=True, exist_ok=True)
        except (OSError, RuntimeError):  # read-only, or no home
            continue
        if os.access(place / name, os.W_OK):
            return place / name
    return Path(tempfile.mkdtemp(prefix=name))


if not config.CACHE_DIR:  # else the user has said where
    config.CACHE_DIR = str(_cache_folder())

# Fast mathematics without "nnan" and "ninf": a model that blows up shall be seen to. NumPy's errors: Python's test of
# every divisor keeps loops from becoming vector instructions.
COMPILED: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "fastmath": {"reassoc", "contract", "nsz", "arcp"},
    "error_model": "numpy",
}
# A number in the source would be a double and take the whole expression with it.
ZERO, HALF, ONE, _TWO, _LARGE = (np.float32(x) for x in (0, 0.5, 1, 2, 9))
_P0, _P1, _P2 = (np.float32(x) for x in (135135, 17325, 378))
_Q0, _Q1, _Q2, _Q3 = (np.float32(x) for x in (135135, 62370, 3150, 28))


@njit(**COMPILED)
def tanh(x: np.float32) -> np.float32:
    """tanh x to 1.3e-7: Lambert's continued fraction of tanh(x/2) to depth 7, then tanh 2y = 2 tanh y/(1 + tanh² y).

    Beyond ±9 it is ±1 in single precision.
    """
    y = HALF * (-_LARGE if x < -_LARGE else _LARGE if x > _LARGE else x)  # in this order NaN is kept
    s = y * y
    t = y * (_P0 + s * (_P1 + s * (_P2 + s))) / (_Q0 + s * (_Q1 + s * (_Q2 + _Q3 * s)))
    return _TWO * t / (ONE + t * t)
