"""Memory by its address: what a callback without an interpreter is given is a pointer."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, njit, types
from numba.extending import intrinsic

from engine.kernels.compiled import COMPILED

# mypy: disable-error-code="no-untyped-def"


@intrinsic
def pointer(typing_context: Any, address: Any):
    """A `void *` from an address (int64)."""

    def generate(_context, builder, _signature, arguments):
        return builder.inttoptr(arguments[0], ir.IntType(8).as_pointer())

    return types.voidptr(types.int64), generate


@intrinsic
def fence(typing_context: Any):
    """What was written before is seen by other threads before what is written after."""

    def generate(context, builder, _signature, _arguments):
        builder.fence("seq_cst")
        return context.get_dummy_value()

    return types.void(), generate


@njit(inline="always", **COMPILED)
def reals(address: int) -> np.ndarray:
    """The memory at an address (int64) as real numbers, of no stated length."""
    return carray(pointer(address), (1 << 40,), np.float64)


@njit(inline="always", **COMPILED)
def wholes(address: int) -> np.ndarray:
    """The same as whole numbers."""
    return carray(pointer(address), (1 << 40,), np.int64)


@njit(**COMPILED)
def publish(slots: np.ndarray, slot: int, whole: int) -> None:
    """Writes a whole number into one of the slots, int64 (n,), after all that was written before.

    A thread that reads the number before a fence sees what it stands for. What is read afterwards is no older.
    """
    fence()
    slots[slot] = whole
    fence()
