"""A panel: a view, and what decides what it shows.

A view (`app/views/`) draws what it is given and emits signals for gestures. Its panel is called when choices change,
when another motion is rendered, and for each frame; it computes what is to be drawn, and turns gestures into changes
of the session or into the signals here. Everything runs in the window's thread; what takes longer than a few
milliseconds belongs in a thread of the panel's own, ended in `close`.
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
    """What is to be shown now.

    Attributes:
        take: the motion, or None before the first.
        position_s: the playhead, from the pluck on: what is heard now.
        playing: whether the playhead moves.
        elapsed_s: since the last call of `show_moment`, by the clock.
    """

    take: Take | None
    position_s: float
    playing: bool
    elapsed_s: float

    def standing(self, choices: Choices) -> tuple[object, ...]:
        """What a picture of the take depends on: while it is equal and nothing plays, the picture is the same."""
        return self.take, self.take.progress if self.take is not None else (), self.position_s, choices


class Panel(QObject):
    """Subclasses set `key`, `title`, `help` and `view`, and override the methods that they need."""

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
        """Called with the fields of `Choices` that have new values; at the start with all of them."""

    def take_started(self, take: Take) -> None:
        """Called with another motion, of which nothing is rendered yet; it grows from now on."""

    def take_finished(self, take: Take, errors: ErrorSums) -> None:
        """Called when all of it is rendered, with the sums of its errors."""

    def show_moment(self, moment: Moment) -> None:
        """Called while the panel is visible: for the string 60 times a second, for the others 30, less at rest."""

    def close(self) -> None:
        """Called when the window closes: ends the panel's threads."""
