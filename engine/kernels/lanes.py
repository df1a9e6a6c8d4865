"""Modes in blocks of four, side by side: the inner loops of latents that share a tension, as vector instructions.

A block is one piece of memory, `BLOCK` numbers: rows (LANES,) of four modes. All of a mode's numbers thus come from
one stream, on a boundary that vector instructions like; unused lanes are zero. Loops that a compiler makes into
vectors by itself must first find out whether two rows overlap; they take the last few modes one by one: at ten to a
hundred modes that took longer than the work.

An *ear* is a set of weights at one listening point. All ears hear `near` blocks; the `far` blocks, which follow them
in memory, are heard by none and only stretch the string.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from engine.kernels.compiled import inlined, kernel
from engine.kernels.mixer_records import MOST_EARS

# mypy: disable-error-code="no-untyped-def"

LANES = 4
# Rows of a block: z = x + iy, those of `kernels.tension.prepare`, and the output
X, Y, COSINE, SINE, KICK, STRETCH, RATIO, SEEN, SQUARE = range(9)
EARS = 9  # the weights of each
ROWS = EARS + MOST_EARS
BLOCK = ROWS * LANES

EAR_COUNTS = (0, 1, 2, 4)
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
ONES = ir.Constant(_VECTOR, [1.0] * LANES)
_WHOLE, _LANE = ir.IntType(64), ir.IntType(32)


@kernel
def place(number: int) -> int:
    """Slot of the first row of the mode with this number, from the first block on; rows are LANES apart."""
    return number // LANES * BLOCK + number % LANES


@kernel
def blocks_of(modes: int) -> int:
    """The number of blocks that so many modes fill, the last one in part."""
    return (modes + LANES - 1) // LANES


@kernel
def slots(modes: int) -> int:
    """Room for the blocks of so many modes in two groups, wherever the memory begins."""
    return (blocks_of(modes) + 2) * BLOCK


@intrinsic
def aligned(typing_context: Any, memory: Any):
    """The first slot of memory, float64 (n,), at which a block may begin."""

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        address = builder.udiv(builder.ptrtoint(data, _WHOLE), _WHOLE(8))
        return builder.and_(builder.neg(address), _WHOLE(LANES - 1))

    return types.int64(memory), generate


class _Blocks:
    """A writer of code: of a loop over blocks of four modes, and of so many sums over all of them.

    Its values are LLVM's, of the code that it writes. A sum is a vector, (LANES,), until `totals`.
    """

    def __init__(self, context, builder, memory_type, memory, sums: int) -> None:
        self.builder = builder
        self._data = context.make_array(memory_type)(context, builder, memory).data
        self._sums = [cgutils.alloca_once_value(builder, ir.Constant(_VECTOR, [0.0] * LANES)) for _ in range(sums)]

    def spread(self, value):
        """The same number in all lanes."""
        nothing = ir.Constant(_VECTOR, ir.Undefined)
        one = self.builder.insert_element(nothing, value, _LANE(0))
        return self.builder.shuffle_vector(one, nothing, ir.Constant(ir.VectorType(_LANE, LANES), [0] * LANES))

    def begin(self, first, block, slots: int = BLOCK) -> None:
        """Let the rows be those of a block, by its number, of blocks of so many slots from the slot `first` on."""
        self._place = self.builder.add(first, self.builder.mul(block, _WHOLE(slots)))

    def row(self, which: int):
        return self.builder.load(self._row(which), align=8 * LANES)

    def set_row(self, which: int, value) -> None:
        self.builder.store(value, self._row(which), align=8 * LANES)

    def _row(self, which: int):
        slot = self.builder.add(self._place, _WHOLE(which * LANES))
        return self.builder.bitcast(self.builder.gep(self._data, [slot]), _VECTOR.as_pointer())

    def sweep(self, first, blocks, ears: int, linear=None, squared=None) -> None:
        """Turn blocks, and add what they give to the sums, see `_sweep`; without `linear` they are only summed.

        Args:
            linear, squared: S (1 - 2R) and S², in all lanes.
        """
        builder = self.builder
        with cgutils.for_range(builder, blocks) as loop:
            self.begin(first, loop.index)
            x, ratio = self.row(X), self.row(RATIO)
            if linear is not None:
                share = builder.fsub(linear, builder.fmul(ratio, squared))
                y = builder.fadd(self.row(Y), builder.fmul(builder.fmul(self.row(KICK), share), x))
                cosine, sine = self.row(COSINE), self.row(SINE)
                self.set_row(Y, builder.fadd(builder.fmul(sine, x), builder.fmul(cosine, y)))
                x = builder.fsub(builder.fmul(cosine, x), builder.fmul(sine, y))
                self.set_row(X, x)
            self.stretch(x, ratio)
            lifted = builder.fmul(self.row(SEEN), x) if ears else x
            for ear in range(ears):
                weight = self.row(EARS + ear)
                self.add(2 + 2 * ear, weight, x)
                self.add(3 + 2 * ear, weight, lifted)

    def stretch(self, x, ratio) -> None:
        """Add what modes stretch the string by to the first two sums."""
        stretch = self.builder.fmul(self.row(STRETCH), self.builder.fmul(x, x))
        self.add(0, stretch, ONES)
        self.add(1, stretch, ratio)

    def add(self, which: int, one, other) -> None:
        """Add a product to a sum."""
        product = self.builder.fmul(one, other)
        self.builder.store(self.builder.fadd(self.builder.load(self._sums[which]), product), self._sums[which])

    def totals(self) -> list[Any]:
        """The sums, over the lanes too, always in one order."""
        scalars = []
        for pointer in self._sums:
            total, width = self.builder.load(pointer), LANES
            while width > 1:
                width //= 2
                halves = [
                    ir.Constant(ir.VectorType(_LANE, width), [*range(first, first + width)]) for first in (0, width)
                ]
                low, high = (self.builder.shuffle_vector(total, total, half) for half in halves)
                total = self.builder.fadd(low, high)
            scalars.append(self.builder.extract_element(total, _LANE(0)))
        return scalars


def _sweep(turns: bool):
    """The kick of the common tension and the turn to the next node, or only the sums at the present one.

    Returns a function of `near` blocks, which 0, 1, 2 or 4 ears hear, and the `far` ones behind them; of S (1 - 2R)
    and S². It gives Σ η² A x² and Σ η² κ r x² at the node where they are then. It writes two sums for each ear to
    `heard`: that of the weights, and that of the weights times κ p.
    """

    @intrinsic
    def sweep(typing_context, memory, first, near, far, ears, linear, squared, at_points):
        """The code of a sweep, which takes each number by itself, so that all stay in registers."""

        def generate(context, builder, signature, arguments):
            first, near, far, ears = arguments[1:5]
            behind = builder.add(first, builder.mul(near, _WHOLE(BLOCK)))
            felt = [cgutils.alloca_once(builder, ir.DoubleType()) for _ in range(2)]
            heard = context.make_array(signature.args[7])(context, builder, arguments[7]).data
            for count in EAR_COUNTS:
                with builder.if_then(builder.icmp_signed("==", ears, _WHOLE(count))):
                    code = _Blocks(context, builder, signature.args[0], arguments[0], 2 + 2 * count)
                    shares = [code.spread(share) for share in arguments[5:7]] if turns else []
                    code.sweep(first, near, count, *shares)
                    code.sweep(behind, far, 0, *shares)
                    for slot, total in enumerate(code.totals()):
                        place = felt[slot] if slot < 2 else builder.gep(heard, [_WHOLE(slot - 2)])
                        builder.store(total, place)
            return context.make_tuple(builder, signature.return_type, [builder.load(total) for total in felt])

        return types.UniTuple(types.float64, 2)(memory, first, near, far, ears, linear, squared, at_points), generate

    return sweep


turn, _sum = (_sweep(turns) for turns in (True, False))


@inlined
def add_up(
    memory: np.ndarray, first: int, near: int, far: int, ears: int, at_points: np.ndarray
) -> tuple[float, float]:
    """Return (S, R) of blocks as they are, and write what ears hear to `at_points`: as `turn`, without a turn."""
    return _sum(memory, first, near, far, ears, 0.0, 0.0, at_points)


@intrinsic
def energies(typing_context: Any, memory: Any, first: Any, blocks: Any):
    """Σ |z|² and Σ ω² |z|² of blocks."""

    def generate(context, builder, signature, arguments):
        code = _Blocks(context, builder, signature.args[0], arguments[0], 2)
        with cgutils.for_range(builder, arguments[2]) as loop:
            code.begin(arguments[1], loop.index)
            x, y = code.row(X), code.row(Y)
            size = builder.fadd(builder.fmul(x, x), builder.fmul(y, y))
            code.add(0, size, ONES)
            code.add(1, size, code.row(SQUARE))
        return context.make_tuple(builder, signature.return_type, code.totals())

    return types.UniTuple(types.float64, 2)(memory, first, blocks), generate


@intrinsic
def felt(typing_context, memory, blocks, modes, parts):
    """The sums over blocks of x, and of x κ p, times the first row of their parts.

    `modes` and `parts` are first slots: of the blocks, and of (blocks, PRESSED, LANES), as in `press`.
    """

    def generate(context, builder, signature, arguments):
        code, part = (_Blocks(context, builder, signature.args[0], arguments[0], 2) for _ in range(2))
        with cgutils.for_range(builder, arguments[1]) as loop:
            code.begin(arguments[2], loop.index)
            part.begin(arguments[3], loop.index, PRESSED * LANES)
            moved = builder.fmul(part.row(0), code.row(X))
            code.add(0, moved, ONES)
            code.add(1, moved, code.row(SEEN))
        return context.make_tuple(builder, signature.return_type, code.totals())

    return types.UniTuple(types.float64, 2)(memory, blocks, modes, parts), generate


PRESSED = 3  # rows of parts in a contact: displacement there, and what x and y change by with a force of 1 N


@intrinsic
def press(typing_context, memory, blocks, modes, parts, force):
    """Change x and y of blocks by a force at a contact, and return their sums, as `turn` does.

    `modes` is the first slot of the blocks, `parts` that of (blocks, PRESSED, LANES).
    """

    def generate(context, builder, signature, arguments):
        code, part = (_Blocks(context, builder, signature.args[0], arguments[0], 2) for _ in range(2))
        force = code.spread(arguments[4])
        with cgutils.for_range(builder, arguments[1]) as loop:
            code.begin(arguments[2], loop.index)
            part.begin(arguments[3], loop.index, PRESSED * LANES)
            x, y = (builder.fadd(code.row(axis), builder.fmul(part.row(1 + axis), force)) for axis in (X, Y))
            code.set_row(X, x)
            code.set_row(Y, y)
            code.stretch(x, code.row(RATIO))
        return context.make_tuple(builder, signature.return_type, code.totals())

    return types.UniTuple(types.float64, 2)(memory, blocks, modes, parts, force), generate


PARTS, PART_BLOCKS = 3, 12  # rows of parts in a bridge: of y and x in its motion, and of that in y; of so many blocks


@intrinsic
def meet(typing_context, memory, blocks, strings, modes, parts):
    """Let the bridge that 1, 2 or 3 strings share take from each what its modes have in it, block by block.

    `modes` and `parts` are three first slots each, of their modes and of their parts (PARTS, PART_BLOCKS, LANES).
    """

    def generate(context, builder, signature, arguments):
        first_modes, first_parts = (cgutils.unpack_tuple(builder, each, 3) for each in arguments[3:])
        for count in (1, 2, 3):
            with builder.if_then(builder.icmp_signed("==", arguments[2], _WHOLE(count))):
                codes = [_Blocks(context, builder, signature.args[0], arguments[0], 0) for _ in range(2 * count)]
                pairs = list(zip(codes[:count], first_modes, codes[count:], first_parts, strict=False))
                with cgutils.for_range(builder, arguments[1]) as loop:
                    moved = ir.Constant(_VECTOR, [0.0] * LANES)
                    for code, modes, part, parts in pairs:
                        code.begin(modes, loop.index)
                        part.begin(parts, loop.index, LANES)
                        moved = builder.fadd(moved, builder.fmul(part.row(0), code.row(Y)))
                        moved = builder.fadd(moved, builder.fmul(part.row(PART_BLOCKS), code.row(X)))
                    for code, _, part, _ in pairs:
                        code.set_row(Y, builder.fsub(code.row(Y), builder.fmul(part.row(2 * PART_BLOCKS), moved)))
        return context.get_dummy_value()

    return types.void(memory, blocks, strings, modes, parts), generate
