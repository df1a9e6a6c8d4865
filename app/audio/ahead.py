"""What the feeder knew before each block in the queue: a command goes back to the first that it can change."""

from __future__ import annotations

import copy
from collections import deque
from dataclasses import dataclass

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


class Ahead:
    """Moments and the status after them, one of each for a block in the queue."""

    def __init__(self) -> None:
        self._blocks: deque[tuple[Moment, MixerStatus]] = deque()

    def note(self, before: Moment, after: MixerStatus) -> None:
        """The latest block: what was before it, and what is after it."""
        self._blocks.append((before, after))

    def forget_played(self, queued_blocks: int) -> None:
        while len(self._blocks) > queued_blocks:
            self._blocks.popleft()

    def go_back(self, blocks: int) -> Moment | None:
        """The moment before the last so many, which are forgotten; None where they are none of ours."""
        moment = None
        for _ in range(min(blocks, len(self._blocks))):
            moment, _ = self._blocks.pop()
        return moment

    def status_in(self, blocks: int) -> MixerStatus | None:
        """After the block that is `blocks` from the loudspeaker, or the last before it."""
        return self._blocks[min(blocks, len(self._blocks)) - 1][1] if self._blocks else None
