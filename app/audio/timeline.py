"""Which moment of the track is being heard now, while newer blocks are already queued."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple


class _Entry(NamedTuple):
    end_frame: int  # output frames queued up to the end of the block
    position_frames: int  # of the playhead at that end
    moving: bool


class Timeline:
    """Remembers the playhead at the end of each queued block until that block has been heard."""

    def __init__(self, position_frames: int) -> None:
        self._entries: deque[_Entry] = deque()
        self._last = _Entry(0, position_frames, False)

    def note(self, end_frame: int, position_frames: int, moving: bool) -> None:
        self._entries.append(_Entry(end_frame, position_frames, moving))

    def take_back(self, end_frame: int) -> None:
        """Forgets the blocks after `end_frame`: they left the queue unheard."""
        while self._entries and self._entries[-1].end_frame > end_frame:
            self._entries.pop()

    def position_at(self, frame: int) -> int:
        """The playhead when output frame `frame` is heard; frames are asked for in rising order.

        Reckoned backwards from the end of the block, because jumps happen at the beginning of one (only the
        wrap of a loop may lie within, and then the playhead is early by less than a block).
        """
        while self._entries and self._entries[0].end_frame < frame:
            self._last = self._entries.popleft()
        if not self._entries:
            return self._last.position_frames
        entry = self._entries[0]
        if not entry.moving:
            return entry.position_frames
        return max(entry.position_frames - (entry.end_frame - frame), 0)
