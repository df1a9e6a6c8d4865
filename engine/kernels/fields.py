"""The fields of records: eight-byte numbers, whole (W) or real (R), so that places can be counted in slots."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

W, R = np.int64, np.float64


def slot(kind: np.dtype[np.void], name: str) -> int:
    """The slot of a field: its place in a record, in eight-byte numbers."""
    assert kind.fields is not None
    return int(kind.fields[name][1]) // 8


def slots(kind: np.dtype[np.void]) -> int:
    """The size of a record in eight-byte numbers."""
    return kind.itemsize // 8


def record_of(memory: NDArray[np.float64], kind: np.dtype[np.void]) -> np.void:
    """The record at the beginning of memory, which shares it."""
    return memory[: slots(kind)].view(kind)[0]
