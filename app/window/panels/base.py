"""A panel: a view, and the rules by which it shows what is on stage.

A view (`app/views/`) only knows how to draw what it is given and which gestures it offers. Its panel listens to the
session and to the stage, computes what is to be drawn, and turns gestures into intents: of the session, or of the
controller through the signals here. Everything runs in the window's thread; what takes longer than a few milliseconds
belongs in a thread of the panel's own, ended in `close`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget

from app.presets.library import Library
from app.rendering import Take
from app.session.choices import Choices, Session
from engine.metrics import ErrorSums


@dataclass(frozen=True)
class Moment:
    """What is on stage now.

    Attributes:
        take: the motion, or None before the first.
        position_s: the playhead, of what is heard now.
        elapsed_s: of the watcher's time since the last moment.
    """

    take: Take | None
    position_s: float
    playing: bool
    elapsed_s: float

    def standing(self, choices: Choices) -> tuple[object, ...]:
        """What a picture of the take depends on; as long as it is the same and nothing plays, so is the picture."""
        return self.take, self.take.progress if self.take is not None else (), self.position_s, choices


class Panel(QObject):
    """See the module. Subclasses set `key`, `title`, `view` and override what concerns them."""

    key: ClassVar[str]  # in `Choices.left_view` or `right_view`
    title: ClassVar[str]  # on its tab
    help: ClassVar[str] = ""  # what the view shows, in a sentence or two, for the help dialog
    view: QWidget
    on_the_left = False  # in which deck

    seek_asked = Signal(float)  # move the playhead to this time in s
    pluck_asked = Signal()
    told = Signal(str, str)  # a notice for the user, and its details

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__()
        self.session = session
        self.library = library

    def choices_changed(self, names: frozenset[str]) -> None:
        """Fields of `Choices` that have new values; at the start all of them."""

    def take_started(self, take: Take) -> None:
        """Another motion is on stage; it grows from now on."""

    def take_finished(self, take: Take, errors: ErrorSums) -> None:
        """All of it is there."""

    def show_moment(self, moment: Moment) -> None:
        """Sixty times a second for the string, thirty for the others, while the panel can be seen."""

    def close(self) -> None:
        """The window closes."""
