"""NumPy or torch, whichever made the values: a law is written once for arrays and for tensors.

Both have the same names for what such a law uses. Torch is never imported here: who gives tensors has it.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

Values = Any  # a NumPy array, or a tensor


def library_of(values: Values) -> Any:
    """NumPy of an array, torch of a tensor."""
    return np if isinstance(values, np.ndarray) else sys.modules["torch"]


def in_double(values: Values) -> Values:
    """The values in double precision."""
    return values.astype(np.float64, copy=False) if isinstance(values, np.ndarray) else values.double()


def as_array(values: Values) -> NDArray[Any]:
    """The values as an array that shares their memory; gradients do not pass through it."""
    return values if isinstance(values, np.ndarray) else np.asarray(values.detach())
