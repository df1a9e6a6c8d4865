"""What the feeder knew before each block in the queue.

A command goes back to the first that it can change, and rendering to the first that lacked what it brings.
"""

from __future__ import annotations

import copy
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.audio.mixer import Mixer, MixerStatus
from app.audio.tone import Tone


@dataclass(frozen=True)
class Moment:
    """All that the next block depends on, apart from what is rendered meanwhile. A copy, so that it stays."""

    mixer: Mixer
    tone: Tone | None

    @classmethod
    def of(cls, mixer: Mixer, tone: Tone | None) -> Moment:
        return cls(mixer.copied(), copy.copy(tone))

    def again(self) -> tuple[Mixer, Tone | None]:
        """A mixer and a tone to go on with from here; the moment stays."""
        return self.mixer.copied(), copy.copy(self.tone)


@dataclass(frozen=True)
class Mixed:
    """A block, what was before it, and the status after it.

    Attributes:
        steady: whether only a command can make another block of it; otherwise rendering can, too.
    """

    before: Moment
    steady: bool
    block: NDArray[np.float32]
    after: MixerStatus


class Ahead:
    """The blocks in the queue, with what was known before each."""

    def __init__(self) -> None:
        self._blocks: deque[Mixed] = deque()

    def note(self, mixed: Mixed) -> None:
        """The latest block in the queue."""
        self._blocks.append(mixed)

    def forget_played(self, queued_blocks: int) -> None:
        while len(self._blocks) > queued_blocks:
            self._blocks.popleft()

    def moment_before(self, blocks: int) -> Moment | None:
        """What was before the last so many; None where they are none, or not all of them ours."""
        return self._blocks[-blocks].before if 0 < blocks <= len(self._blocks) else None

    def settled(self, blocks: int, frames: int) -> int:
        """How many of the last `blocks`, of `frames` each, follow from the first that is steady now and was not.

        They were mixed before rendering had come so far, and can be mixed better.
        """
        for number in range(min(blocks, len(self._blocks)), 0, -1):
            mixed = self._blocks[-number]
            if not mixed.steady and mixed.before.mixer.steady(frames):
                return number
        return 0

    def forget_last(self, blocks: int) -> None:
        for _ in range(min(blocks, len(self._blocks))):
            self._blocks.pop()

    def status_in(self, blocks: int) -> MixerStatus | None:
        """After the block that is `blocks` from the loudspeaker, or the last before it."""
        return self._blocks[min(blocks, len(self._blocks)) - 1].after if self._blocks else None
