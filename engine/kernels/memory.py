"""Memory by its address: what a callback without an interpreter is given is a pointer."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

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


def _array(context, builder, kind, data, shape):
    """Numbers of eight bytes at a pointer, which belong to somebody else: nobody counts references to them."""
    found, size = context.make_array(kind)(context, builder), context.get_constant(types.intp, 8)
    strides = [size] if len(shape) == 1 else [builder.mul(shape[1], size), size]
    populate_array(found, data=data, shape=shape, strides=strides, itemsize=size, meminfo=None)
    return found._getvalue()


def _at(number: Any):
    """An intrinsic: the memory at an address (int64) as numbers of a kind."""
    kind = types.Array(number, 1, "C")

    @intrinsic
    def memory(typing_context, address):
        def generate(context, builder, _signature, arguments):
            data = builder.inttoptr(arguments[0], context.get_data_type(number).as_pointer())
            return _array(context, builder, kind, data, [context.get_constant(types.intp, 1 << 40)])

        return kind(types.int64), generate

    return memory


_reals, _wholes = _at(types.float64), _at(types.int64)


@njit(**COMPILED)
def reals(address: int) -> np.ndarray:
    """The memory at an address (int64) as real numbers, of no stated length."""
    return _reals(address)


@njit(**COMPILED)
def wholes(address: int) -> np.ndarray:
    """The same as whole numbers."""
    return _wholes(address)


@intrinsic
def part(typing_context: Any, memory: Any, first: Any, count: Any):
    """`memory[first : first + count]`, whose bounds nobody checks."""

    def generate(context, builder, signature, arguments):
        data = context.make_array(memory)(context, builder, arguments[0]).data
        return _array(context, builder, memory, builder.gep(data, [arguments[1]]), [arguments[2]])

    return memory(memory, types.int64, types.int64), generate


@intrinsic
def table(typing_context: Any, memory: Any, first: Any, rows: Any, columns: Any):
    """The same as an array (rows, columns)."""
    kind = types.Array(memory.dtype, 2, "C", readonly=not memory.mutable)

    def generate(context, builder, signature, arguments):
        data = context.make_array(memory)(context, builder, arguments[0]).data
        return _array(context, builder, kind, builder.gep(data, [arguments[1]]), arguments[2:])

    return kind(memory, types.int64, types.int64, types.int64), generate


@njit(**COMPILED)
def publish(slots: np.ndarray, slot: int, whole: int) -> None:
    """Writes a whole number into one of the slots, int64 (n,), after all that was written before.

    A thread that reads the number before a fence sees what it stands for. What is read afterwards is no older.
    """
    fence()
    slots[slot] = whole
    fence()
