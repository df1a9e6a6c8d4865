"""The time at which an event is due that is handed over before its time."""

from __future__ import annotations

from dataclasses import dataclass

from engine.voices import Mixer


@dataclass(frozen=True)
class Due:
    """A frame of a mixer, at which an event counts; at once, where another mixer has taken its place.

    Attributes:
        time_s: the same on the clock of `time.monotonic`, in s.
    """

    mixer: Mixer
    frame: int
    time_s: float

    def frame_in(self, mixer: Mixer) -> int:
        """The frame of this mixer; 0, at once, where it is another."""
        return self.frame if mixer is self.mixer else 0
