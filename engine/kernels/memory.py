"""Memory by its address: what a callback without an interpreter is given is a pointer."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import from_dtype, types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from engine.kernels import mixer_records, records, voice_records
from engine.kernels.compiled import kernel

# mypy: disable-error-code="no-untyped-def"


@intrinsic
def pointer(typing_context: Any, address: Any):
    """A `void *` from an address (int64)."""

    def generate(_context, builder, _signature, arguments):
        return builder.inttoptr(arguments[0], ir.IntType(8).as_pointer())

    return types.voidptr(types.int64), generate


@intrinsic
def fence(typing_context: Any):
    """Order memory: other threads see what was written before ahead of what is written after."""

    def generate(context, builder, _signature, _arguments):
        builder.fence("seq_cst")
        return context.get_dummy_value()

    return types.void(), generate


def _array(context, builder, kind, data, shape):
    """Numbers of eight bytes at a pointer, which belong to somebody else: nobody counts references to them."""
    array, size = context.make_array(kind)(context, builder), context.get_constant(types.intp, 8)
    strides = [size]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(length, strides[0]))
    populate_array(array, data=data, shape=shape, strides=strides, itemsize=size, meminfo=None)
    return array._getvalue()


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


reals, wholes = _at(types.float64), _at(types.int64)  # of no stated length


def record_at(dtype: np.dtype[np.void]) -> Any:
    """An intrinsic: the record at an address (int64, or a `void *`)."""
    kind = from_dtype(dtype)

    @intrinsic
    def memory(typing_context, address):
        def generate(context, builder, signature, arguments):
            lead = builder.bitcast if signature.args[0] == types.voidptr else builder.inttoptr
            return lead(arguments[0], context.get_value_type(kind))

        return kind(types.voidptr if address == types.voidptr else types.int64), generate

    return memory


player_at, table_at = record_at(records.PLAYER), record_at(records.TABLE)
# Their rows, curves, samples or partitions follow
drum_at, recorded_at, attack_at = map(record_at, (records.DRUM, records.RECORDED, records.ATTACK))
body_at, responses_at, needs_at = map(record_at, (records.BODY, records.RESPONSES, records.NEEDS))
voice_at, wish_at = record_at(voice_records.VOICE), record_at(voice_records.WISH)
truth_program_at, tension_program_at = map(record_at, (voice_records.TRUTH_PROGRAM, voice_records.TENSION_PROGRAM))
bank_program_at, rendered_program_at = map(record_at, (voice_records.BANK_PROGRAM, voice_records.RENDERED_PROGRAM))
mixer_at, convolver_at = record_at(mixer_records.MIXER), record_at(mixer_records.CONVOLVER)
impulse_at = record_at(mixer_records.IMPULSE)


@intrinsic
def address_of(typing_context: Any, record: Any):
    """The address (int64) of a record."""

    def generate(context, builder, _signature, arguments):
        return builder.ptrtoint(arguments[0], ir.IntType(64))

    return types.int64(record), generate


@intrinsic
def clear(typing_context: Any, record: Any):
    """Fill a record with zeros."""

    def generate(context, builder, signature, arguments):
        pointer = builder.bitcast(arguments[0], ir.IntType(8).as_pointer())
        cgutils.memset(builder, pointer, context.get_constant(types.intp, record.size), 0)
        return context.get_dummy_value()

    return types.void(record), generate


@intrinsic
def copy(typing_context: Any, into: Any, record: Any):
    """Write a record over another of its kind."""

    def generate(context, builder, signature, arguments):
        to, source = (builder.bitcast(pointer, ir.IntType(8).as_pointer()) for pointer in arguments)
        cgutils.memcpy(builder, to, source, context.get_constant(types.intp, into.size))
        return context.get_dummy_value()

    return types.void(into, record), generate


@intrinsic
def part(typing_context: Any, memory: Any, first: Any, count: Any):
    """The numbers `memory[first : first + count]`, whose bounds nobody checks."""

    def generate(context, builder, signature, arguments):
        data = context.make_array(memory)(context, builder, arguments[0]).data
        return _array(context, builder, memory, builder.gep(data, [arguments[1]]), [arguments[2]])

    return memory(memory, types.int64, types.int64), generate


@kernel
def behind(record: Any, slot: int, count: int) -> np.ndarray:
    """The real numbers, as many as `count`, from a slot of a record that they follow, counted from its beginning."""
    return part(reals(address_of(record)), slot, count)


@intrinsic
def shaped(typing_context: Any, memory: Any, first: Any, shape: Any):
    """The numbers of memory from the slot `first` on as an array of any shape, whose bounds nobody checks."""
    kind = types.Array(memory.dtype, len(shape), "C", readonly=not memory.mutable)

    def generate(context, builder, signature, arguments):
        data = context.make_array(memory)(context, builder, arguments[0]).data
        lengths = cgutils.unpack_tuple(builder, arguments[2])
        return _array(context, builder, kind, builder.gep(data, [arguments[1]]), lengths)

    return kind(memory, types.int64, types.UniTuple(types.intp, len(shape))), generate


@kernel
def publish(slots: np.ndarray, slot: int, whole: int) -> None:
    """Write a whole number into one of the slots, int64 (n,), after all that was written before.

    A thread that reads the number before a fence sees what it stands for. What is read afterwards is no older.
    """
    fence()
    slots[slot] = whole
    fence()


@kernel
def mixed(number: int) -> int:
    """A number with all bits mixed (splitmix64): noise, the same for the same numbers."""
    bits = np.uint64(number) * np.uint64(0x9E3779B97F4A7C15)
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return int(np.int64(bits ^ (bits >> np.uint64(31))))
