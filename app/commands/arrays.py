"""Displacements in NumPy files: U0.npy (batch, points) is read, OUT.npy (batch, frames, points) is written."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from engine.plain_text import one_line
from engine.whole_file import result_file
from training.cli.console import Failure, ProgressReport

Array = NDArray[np.floating]
MOST_NUMBERS = 8 * 2**20  # of a file of displacements: 64 MiB in double precision
LARGEST_RESULT_BYTES = 4 * 2**30
BYTES_AT_ONCE = 16 * 2**20  # of a result, computed at a time
FRAMES_AT_ONCE = 4096
IMPLAUSIBLE_PEAK_M = 0.1  # a larger displacement is probably meant in millimetres

# displacements (batch, points) -> blocks (batch, frames, points) from frame 0 to the last, in m
Motion = Callable[[Array], Iterator[Array]]


def read_displacements(path: Path) -> Array:
    """Initial displacements in m, float64 (batch, points).

    Raises:
        Failure: missing, not a NumPy file, of another shape or type, too large, or not finite.
    """
    array = _load(path)
    if array.ndim != 2 or 0 in array.shape:
        hint = "; for one string save u[None]" if array.ndim == 1 else ""
        raise Failure(f"{path}: has shape {array.shape}, expected (batch, points){hint}")
    if array.dtype.kind not in "fiu":
        raise Failure(f"{path}: holds {array.dtype}, expected real numbers; save u.astype(float)")
    if array.size > MOST_NUMBERS:
        raise Failure(f"{path}: has shape {array.shape}; at most {MOST_NUMBERS} numbers may be given: split it")
    values = np.array(array, dtype=np.float64)
    if not np.isfinite(values).all():
        row, point = np.argwhere(~np.isfinite(values))[0]
        raise Failure(f"{path}: entry [{row}, {point}] is {values[row, point]}; replace it by a displacement in m")
    return values


def check_result_size(batch: int, frames: int, points: int) -> None:
    """Refuse a result, float64 (batch, frames, points), above `LARGEST_RESULT_BYTES`, before any work.

    Raises:
        Failure: it is larger.
    """
    size = 8 * batch * frames * points
    if size > LARGEST_RESULT_BYTES:
        raise Failure(
            f"the result ({batch}, {frames}, {points}) would take {size / 2**30:.1f} GiB, more than the "
            f"{LARGEST_RESULT_BYTES / 2**30:g} GiB allowed; lower --steps or split U0"
        )


def write_motion(path: Path, initial: Array, steps: int, motion: Motion, report: ProgressReport) -> None:
    """Write float64 (batch, steps + 1, points) in m, whole or not at all, a few trajectories at a time.

    Raises:
        As `write_array`.
    """
    batch, points = initial.shape
    rows = max(1, BYTES_AT_ONCE // (8 * (steps + 1) * points))  # trajectories at a time

    def blocks() -> Iterator[Array]:
        for few in np.split(initial, range(rows, batch, rows)):
            frames: Iterator[Array] = motion(few)
            # a trajectory's frames lie together in the file
            yield from [np.concatenate(list(frames), axis=1)] if len(few) > 1 else frames

    write_array(path, (batch, steps + 1, points), blocks(), report)


def write_array(path: Path, shape: tuple[int, ...], blocks: Iterator[Array], report: ProgressReport) -> None:
    """Write float64 of a shape, whole or not at all, from blocks that follow one another.

    Raises:
        Failure: the motion is not finite.
        WriteError: the file cannot be written.
    """
    done = 0
    with result_file(path) as file:
        npy.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": shape})
        for block in blocks:
            if not np.isfinite(block).all():
                raise Failure("the motion is not finite; displacement is in m: lower U0, or raise --substeps")
            file.write(block.astype("<f8").tobytes())
            done += block.size
            report(done / math.prod(shape))


def blocks_of(advance: Callable[[Any, int], tuple[Array, Any]], state: Any, steps: int) -> Iterator[Array]:
    """The next `steps` frames, in blocks of at most `FRAMES_AT_ONCE`, that `advance` makes from a state."""
    for first in range(0, steps, FRAMES_AT_ONCE):
        block, state = advance(state, min(FRAMES_AT_ONCE, steps - first))
        yield block


def _load(path: Path) -> np.ndarray:
    """The array in a NumPy file, of any shape and type, mapped and not yet read. Raises Failure: there is none."""
    if path.exists() and not path.is_file():  # reading a pipe would block
        raise Failure(f"{path}: not an ordinary file; give a NumPy .npy file")
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)  # mapped: a damaged header allocates no memory
    except FileNotFoundError:
        raise Failure(f"{path}: no such file; give a NumPy .npy file of shape (batch, points) in m") from None
    except OSError as error:
        raise Failure(f"{path}: cannot be read ({error.strerror or error}); give a NumPy .npy file") from error
    except Exception as error:  # NumPy parses the header as a Python literal, which may raise nearly anything
        reason = one_line(str(error), 200)
        raise Failure(
            f"{path}: not a whole NumPy .npy file of numbers ({reason}); save it with numpy.save"
        ) from error
    if not isinstance(array, np.ndarray):
        raise Failure(f"{path}: an archive of arrays; save the one array with numpy.save")
    return array
