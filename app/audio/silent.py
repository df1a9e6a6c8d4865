"""The output where there is none: a clock that takes blocks as a device would, so that pictures move."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from app.audio.devices import AudioDevice
from app.audio.stream import BLOCK_FRAMES

_LONGEST_LAG_S = 0.1  # further behind than this, the clock goes on from now instead of racing to catch up


class SilentOutput:
    """Takes one block per block duration and drops it. The interface is that of `OutputStream`."""

    def __init__(self, rate_hz: int, block_frames: int = BLOCK_FRAMES) -> None:
        self.device: AudioDevice | None = None
        self.rate_hz = rate_hz
        self.block_frames = block_frames
        self.latency_s = 0.0
        self.prompt_blocks = self.queued_blocks = self.replaced_blocks = 0  # nothing waits
        self.changeable_blocks = self.mendable_blocks = 0
        self.underruns = 0
        self.frames_queued = 0
        self._next_block_s = time.monotonic()

    @property
    def frames_written(self) -> int:
        return self.frames_queued

    def replace(self, count: int, blocks: Sequence[NDArray[np.float32]] = ()) -> bool:
        return not count

    def wait_for_space(self, timeout_s: float, ahead: bool = False) -> bool:
        wait_s = self._next_block_s - time.monotonic()
        if wait_s > 0:
            time.sleep(min(wait_s, timeout_s))
        return time.monotonic() >= self._next_block_s

    def stop_waiting(self) -> None:
        pass  # it is a block at most

    def write(self, block: NDArray[np.float32]) -> None:
        self.frames_queued += len(block)
        now_s = time.monotonic()
        if now_s - self._next_block_s > _LONGEST_LAG_S:
            self._next_block_s = now_s
        self._next_block_s += len(block) / self.rate_hz

    def stalled(self) -> bool:
        return False

    def lost(self) -> bool:
        return False

    def close(self) -> None:
        pass
