"""A sound of any length on disk, of which memory holds a block at a time."""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

BLOCK_FRAMES = 2**16


class SoundSamples(Protocol):
    """Samples (frames, points) that can be sliced by frames: an array, or a recording."""

    def __len__(self) -> int: ...
    def __getitem__(self, frames: slice, /) -> NDArray[np.floating]: ...


class Recording:
    """Samples (frames, points), stored in single precision in a temporary file that is deleted with this object.

    Raises:
        OSError: the disk of temporary files is full.
    """

    def __init__(self, points: int) -> None:
        self.points = points
        self._file: Any = tempfile.TemporaryFile(prefix="learned-strings-", buffering=0)  # noqa: SIM115
        weakref.finalize(self, self._file.close)
        self._frames = 0

    def append(self, block: NDArray[np.float32]) -> None:
        """Append frames (n, points)."""
        self.add(len(self), block)

    def add(self, first: int, block: NDArray[np.float32]) -> None:
        """Add frames (n, points or 1) to those from `first` on, which is the end at most."""
        there = self[first : first + len(block)]
        total = np.array(np.broadcast_to(block, (len(block), self.points)), np.float32)
        total[: len(there)] += there
        data = memoryview(total.tobytes())
        self._file.seek(first * self._frame_bytes)
        while data:
            data = data[self._file.write(data) :]
        self._frames = max(self._frames, first + len(block))

    def cut(self, frames: int) -> None:
        """Drop all but the first `frames`."""
        self._frames = min(self._frames, frames)

    def __len__(self) -> int:
        return self._frames

    def __getitem__(self, frames: slice) -> NDArray[np.float64]:
        first, last, _ = frames.indices(self._frames)
        self._file.seek(first * self._frame_bytes)
        values = np.fromfile(self._file, np.float32, max(0, last - first) * self.points)
        return values.reshape(-1, self.points).astype(np.float64)

    @property
    def _frame_bytes(self) -> int:
        return 4 * self.points


def blocks(sound: SoundSamples, frames: int = BLOCK_FRAMES) -> Iterator[tuple[int, NDArray[np.floating]]]:
    """The number of the first frame, and the samples (frames, points), of each block of a sound."""
    for first in range(0, len(sound), frames):
        yield first, sound[first : first + frames]
