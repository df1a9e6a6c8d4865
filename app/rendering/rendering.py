"""The request for a pluck that the render worker renders."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.rendering.note_sound import NoteSound


@dataclass(frozen=True)
class RenderRequest(NoteSound):
    """The sound of a pluck, and how it is drawn.

    Attributes:
        speed: of slow motion; 1 is real time.
        others: further presets whose models are rendered for the same pluck, each as the source `OTHER` + its name.
    """

    speed: float = 1.0
    others: tuple[Path, ...] = ()

    def same_motion(self, other: object) -> bool:
        """Return True if only listening points, slow motion or other presets differ: model and truth move alike."""
        return isinstance(other, RenderRequest) and (self.preset, self.pluck, self.seconds) == (
            other.preset,
            other.pluck,
            other.seconds,
        )
