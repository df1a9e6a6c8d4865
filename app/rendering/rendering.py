"""The request for a pluck that the render worker renders, and the listener to its results."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from app.rendering.blow import BlowTake
from app.rendering.note_sound import NoteSound
from app.rendering.take import Take


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


class RenderListener(Protocol):
    """The listener to the worker's results, called in the worker's thread."""

    def take_started(self, take: Take | BlowTake) -> None:
        """Show that a new pluck or blow has its first block."""

    def take_finished(self, take: Take | BlowTake) -> None:
        """Report that its motion, signals and errors are complete."""

    def other_failed(self, preset: str, message: str) -> None:
        """Report that another preset's model cannot be rendered beside this one; as a source it is at rest."""

    def render_failed(self, message: str, detail: str) -> None:
        """Report that nothing can be rendered. `detail`: the traceback of an unexpected error, else ""."""
