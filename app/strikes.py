"""Plucks that were struck before they were rendered: each sounds as soon as its first block is there.

The window notes what was struck; the render worker begins its sound, in its own thread and before it tells the
window, which may be in the middle of a picture.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

from app.audio import Player, Track
from app.rendering import Take
from engine.pluck import Pluck

MotionKey = tuple[str, Pluck, int]  # the preset's name, the pluck, the number of frames


def motion_key(take: Take) -> MotionKey:
    """What tells the motion of a take from others."""
    return take.preset_name, take.pluck, take.frames


class Strikes:
    """Everything here may be called from any thread and returns at once.

    Args:
        source_heard: what the chosen slot holds at the moment.

    Attributes:
        held: nothing begins by itself, because the player belongs to somebody else.
    """

    def __init__(self, player: Player, source_heard: Callable[[], str]) -> None:
        self._player = player
        self._source_heard = source_heard
        self._lock = threading.Lock()  # what is forgotten under it has not begun and will not
        self._awaited: set[MotionKey] = set()
        self.held = False

    def expect(self, key: MotionKey) -> None:
        """It shall sound when it is there, even if the next one is on stage by then."""
        with self._lock:
            self._awaited.add(key)

    def forget(self) -> None:
        with self._lock:
            self._awaited.clear()

    @property
    def awaited(self) -> frozenset[MotionKey]:
        with self._lock:
            return frozenset(self._awaited)

    def begin(self, take: Take, track: Track) -> bool:
        """Lets it be heard beside what rings already, if it was struck and the player is free for it."""
        with self._lock:
            if self.held or motion_key(take) not in self._awaited:
                return False
            self._awaited.remove(motion_key(take))
            try:
                self._player.strike(track, self._source_heard())
            except ValueError:  # the device has changed its rate: the sound is then made again
                return False
            return True
