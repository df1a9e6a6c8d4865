"""What the render worker is asked for, and whom it tells."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from app.audio import Track
from app.rendering.listening import Listening
from app.rendering.take import Take
from app.sound_names import Pickup
from engine.metrics import ErrorSums
from engine.pluck import Pluck

OTHER = "preset:"  # before the name of another preset whose model is a source


@dataclass(frozen=True)
class RenderRequest:
    """What to render.

    Attributes:
        listen: the only listening point, or the left one.
        sound_rate_hz: the output device's.
        listen_right: the right listening point in stereo.
        solo: above 0, the mode that is heard alone.
        others: further presets whose models are rendered for the same pluck, each the source `OTHER` + its name.
        struck: a pluck that is to sound to its end, even when another one is asked for meanwhile.
    """

    preset: Path
    pluck: Pluck
    seconds: float
    listen: float
    sound_rate_hz: int
    listen_right: float | None = None
    pickup: Pickup = "displacement"
    solo: int = 0
    others: tuple[Path, ...] = ()
    struck: bool = False

    @property
    def listening(self) -> Listening:
        points = (self.listen,) if self.listen_right is None else (self.listen, self.listen_right)
        return Listening(points, self.pickup, self.solo)

    def same_motion(self, other: RenderRequest | None) -> bool:
        """Whether only the sound made from the motion differs, or what is beside it."""
        return other is not None and (self.preset, self.pluck, self.seconds) == (
            other.preset,
            other.pluck,
            other.seconds,
        )


class RenderListener(Protocol):
    """Hears of the worker's results, in the worker's thread."""

    def sound_started(self, take: Take, track: Track) -> bool:
        """A new pluck has its first block; whether it sounds from now on."""

    def take_started(self, take: Take, track: Track, sounds: bool) -> None:
        """The same, told to whoever draws it: at once, or, where it sounds, when there is time for that."""

    def track_replaced(self, take: Take, track: Track) -> None:
        """The same pluck is heard from another point, at another rate, or beside another preset."""

    def take_finished(self, take: Take, errors: ErrorSums) -> None:
        """All of it is there, and measured."""

    def other_failed(self, preset: str, message: str) -> None:
        """Another preset's model cannot be rendered beside this one; as a source it is silent."""

    def render_failed(self, message: str, detail: str) -> None: ...
