"""What the render worker is asked for, and whom it tells."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from app.rendering.subject import Subject
from app.rendering.take import Take
from engine.metrics import ErrorSums
from engine.pluck import Pluck
from engine.voices import Ear


@dataclass(frozen=True)
class RenderRequest:
    """The pictures and signals of a pluck.

    Attributes:
        ear: where and how it is heard.
        speed: of slow motion, 1 being real time.
        others: further presets whose models are rendered for the same pluck, each the source `OTHER` + its name.
    """

    preset: Subject
    pluck: Pluck
    seconds: float
    ear: Ear
    speed: float = 1.0
    others: tuple[Path, ...] = ()

    def same_motion(self, other: RenderRequest | None) -> bool:
        """Whether only what is beside it, where it is heard, or the slow motion differs."""
        return other is not None and (self.preset, self.pluck, self.seconds) == (
            other.preset,
            other.pluck,
            other.seconds,
        )


class RenderListener(Protocol):
    """Hears of the worker's results, in the worker's thread."""

    def take_started(self, take: Take) -> None:
        """A new pluck has its first block."""

    def take_finished(self, take: Take, errors: ErrorSums) -> None:
        """All of it is there, and measured."""

    def other_failed(self, preset: str, message: str) -> None:
        """Another preset's model cannot be rendered beside this one; as a source it is at rest."""

    def render_failed(self, message: str, detail: str) -> None: ...
