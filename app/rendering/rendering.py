"""A motion that the worker renders, block by block: its request, and the frame of a pluck's and of a blow's job."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, Protocol, TypeVar

from app.rendering.blow import BlowRequest, BlowTake
from app.rendering.note_sound import NoteSound
from app.rendering.subject import Loaded, Subject
from app.rendering.take import Listened, Take


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


Request = TypeVar("Request", RenderRequest, BlowRequest)
Made = TypeVar("Made", Take, BlowTake)


class Rendering(ABC, Generic[Request, Made]):
    """The rendering of a request; `advance` does the next block of it, and calls `listener` in its thread.

    Args:
        load: returns a preset's model and truth; raises PresetError.
        helper: another thread, so that two sources are rendered at the same time.

    Attributes:
        take: the result, which grows; None before the first block.
    """

    def __init__(
        self, request: Request, load: Callable[[Subject], Loaded], listener: RenderListener, helper: Executor
    ) -> None:
        self.request: Request = request
        self.take: Made | None = None
        self._load = load
        self._listener = listener
        self._helper = helper
        self._coming: Listened | None = None  # signals at other listening points, until they are complete
        self._finished = False  # whether the listener has been called for it
        self._begun_s = time.monotonic()

    def ask_again(self, request: Request) -> None:
        """Take a request for the same motion: see `same_motion` for what may differ."""
        self.request = request

    def announce(self) -> None:
        """Report again what there is: the window may have shown another motion in between."""
        if self.take is not None:
            self._listener.take_started(self.take)
            if self._finished:
                self._listener.take_finished(self.take)

    @property
    def age_s(self) -> float:
        """Seconds since the request."""
        return time.monotonic() - self._begun_s

    @property
    def rendered_s(self) -> float:
        """Seconds of the motion that are rendered."""
        return 0.0 if self.take is None else self.take.ready_frames / self.take.frames_hz

    @property
    def idle(self) -> bool:
        """Return True if there is nothing left to do."""
        return self.take is not None and self._finished and self._satisfied(self.take)

    def advance(self) -> None:
        """Render a block of each source.

        Raises:
            PresetError: the preset cannot be used.
            ValueError: its model cannot start so.
        """
        begins = self.take is None
        take = self.take = self.take or self._begin()
        self._continue(take)
        if begins:
            self._listener.take_started(take)
        if not self._finished and take.complete and take.listened.complete:
            self._finished = True
            self._listener.take_finished(take)

    @abstractmethod
    def _begin(self) -> Made:
        """Begin what grows from now on."""

    @abstractmethod
    def _continue(self, take: Made) -> None:
        """The next block of it."""

    def _satisfied(self, take: Made) -> bool:
        """Return True if a complete one is as the latest request has it."""
        return self._coming is None and take.listened.ear == self.request.ear
