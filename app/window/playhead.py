"""The motion that is shown and the note whose time it follows: where the playhead stands."""

from __future__ import annotations

from dataclasses import dataclass

from app.playing.key_note import KeyNote
from app.playing.note import PluckVoices
from app.rendering import BlowTake, Take


@dataclass
class Playhead:
    """A motion and the note whose time it follows; without a note it stands at `parked_s`.

    Attributes:
        finished: whether the motion is known to be complete.
    """

    take: Take | BlowTake | None = None
    note: PluckVoices | KeyNote | None = None
    parked_s: float = 0.0
    finished: bool = False

    def position_s(self, latency_s: float) -> float:
        """The time in the motion that is heard now, or where it stands; `latency_s`: of the output."""
        if self.take is None:
            return 0.0
        heard_s = self.parked_s
        if self.note is not None:
            heard_s = max(self.note.seconds - latency_s, self.note.from_s)
        return min(max(heard_s, 0.0), self.take.seconds)

    def park(self, position_s: float) -> None:
        """Park the playhead: it stands at a time of the motion from now on."""
        self.note, self.parked_s = None, position_s

    @property
    def moving(self) -> bool:
        """Return True if it moves."""
        note, take = self.note, self.take
        return note is not None and take is not None and not note.over and note.seconds < take.seconds

    @property
    def audible(self) -> bool:
        """Return True if the note of the motion rings, which may be longer than the motion."""
        return self.note is not None and self.take is not None and not self.note.over
