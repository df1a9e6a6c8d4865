"""A panel: a view and its presenter, which decides what it shows.

It is called when choices change, when another motion is rendered, and for each frame. It computes the drawn figures,
and turns gestures into changes of the session or into the signals here. Everything runs in the window's thread; work
longer than a few milliseconds is a job of its `background`. Jobs give way to playing and drawing: they compute on one
core at a low priority. They rest while a pluck is rendered and while the panel is hidden.
"""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, TypeVar

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QWidget
from threadpoolctl import threadpool_limits

from app.export.columns import Columns
from app.presets.library import Library
from app.rendering import BlowTake, Take
from app.session.choices import Choices
from app.session.monitor import Monitor
from app.session.shown import ShownSource, shown_sources
from app.session.silence import why_silent
from app.shared.worker import Job, Work
from app.stage.session import Session
from app.views.background import Background
from app.views.controls.elided_label import Readout
from app.views.controls.parts import lay_out_alone
from app.views.controls.plain import Label
from app.views.controls.progress_strip import ProgressStrip
from app.views.stage import StageView
from engine.presets import PresetInfo

Location = Literal["stage", "left", "right"]
V = TypeVar("V")
LEAST_HEIGHT = 84  # pixels
GIVEN_UP_S = 0.5  # a take that has not grown for so long is not waited for
UNSEEN_S = 1.0  # a panel for which `look` was not called for so long is hidden
STAGE_FIELDS = {  # of `Choices`: what a picture above the decks depends on
    "face",
    "preset",
    "volume_db",
    "string",
    "pluck",
    "ear",
    *Monitor.model_fields,
}


@dataclass(frozen=True)
class Moment:
    """The moment that is to be shown now: the motion, and where in it the playhead is.

    Attributes:
        sounding: the pluck or the blow that is heard, or None before the first.
        position_s: the playhead, from the pluck on: the time that sounds now.
        playing: whether the playhead moves.
        elapsed_s: since the panels of the same place (stage, left or right) were shown the last moment.
        audible: whether the note of the motion rings.
    """

    sounding: Take | BlowTake | None
    position_s: float
    playing: bool
    elapsed_s: float
    audible: bool = False

    @property
    def take(self) -> Take | None:
        """The motion, if it is of a string; else None."""
        return self.sounding if isinstance(self.sounding, Take) else None

    @property
    def blow(self) -> BlowTake | None:
        """The motion, if it is of a drum; else None."""
        return self.sounding if isinstance(self.sounding, BlowTake) else None

    def standing(self, choices: Choices) -> tuple[object, ...]:
        """The state that a picture of the take depends on.

        While it is equal and nothing plays, the picture is the same.
        """
        sounding = self.sounding
        return sounding, sounding.progress if sounding is not None else (), self.position_s, self.audible, choices

    def in_motion(self, choices: Choices) -> bool:
        """Return True if a picture shows the motion, not rest: in Play as long as its note rings."""
        in_lab_or_audible = self.audible or choices.face != "play"
        return choices.motion and (self.playing or (self.position_s > 0 and in_lab_or_audible))


class Panel(QWidget):
    """A view with its presenter. Subclasses set `key`, `title` and `help`, and override the methods that they need.

    A take is the rendered motion and signals of one pluck (`Take`) or blow (`BlowTake`), which grows while it is
    rendered. A source is the model, the truth, their difference or another preset's model. Slots A and B hold a
    source each; one of them is heard.
    """

    key: ClassVar[str]  # in `Choices.left_view` or `right_view`
    title: ClassVar[str]  # on its tab
    help: ClassVar[str] = ""  # what the view shows, in a sentence or two, for the help dialog
    location: Location = "stage"  # above the decks, or in one
    every: ClassVar[int] = 1  # of so many moments one is drawn
    figure: Any = None  # what is saved and copied: a `Figure`; None: a table, which copies itself
    of_strings: ClassVar[bool] = True  # it shows a string: while a drum is played it says that it does not show it

    seek_asked = Signal(float)  # move the playhead to this time in s
    pluck_asked = Signal()
    strike_asked = Signal(float, float, float)  # the drum at a place, in half-lengths from its centre; velocity
    export_asked = Signal(object)  # the `ComparedModels` that are to be exported
    reported = Signal(str, str)  # a notice for the user, and its details

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__()
        self.session = session
        self.library = library
        self.background = Background(self.key, self, rests=self._rests)
        self.background.failed.connect(self.reported)
        self._cover = Label(self)
        self._cover.setObjectName("cover")
        self._cover.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._cover.setWordWrap(True)
        self._cover.setAutoFillBackground(True)
        self._cover.hide()
        self._seen_s = time.monotonic()  # of the last call of `look`
        self._moments = 0  # shown so far
        self._state: tuple[object, ...] = ()  # all that the drawn picture depends on; (): draw it again
        self._growing: Take | BlowTake | None = None  # the latest take: jobs rest while it is rendered
        self._grown = (-1, 0.0)  # frames ready of it when it last grew (-1: not looked at), and when, in s

    def cover(self, words: str) -> None:
        """Show these words instead of the view; "": the view again."""
        self._cover.setText(words)
        self._cover.setVisible(bool(words))
        self._cover.raise_()

    @property
    def covered(self) -> str:
        """The words that cover it; "": none do."""
        return self._cover.text() if self._cover.isVisibleTo(self) else ""

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._cover.setGeometry(self.rect())

    def columns(self) -> Columns | None:
        """The numbers that are shown now; None: nothing is."""
        raise NotImplementedError(f"{self.key}: a panel has columns(), the numbers that its menu saves")

    def by_heading(self, values: Mapping[str, V], unit: str) -> dict[str, V]:
        """Copy `values`, which are by source, by the headings of columns in files; sources not shown are left out.

        Args:
            unit: of the values, as the heading has it.
        """
        shown = shown_sources(self.session.choices, self.library)
        return {source.heading(unit): values[source.source] for source in shown if source.source in values}

    def choices_changed(self, names: frozenset[str]) -> None:
        """Take the fields of `Choices` that have new values; at the start all of them."""

    def take_started(self, take: Take | BlowTake) -> None:
        """Take another motion, of which nothing is rendered yet; of a drum where it is not `of_strings`."""
        self._growing, self._grown = take, (-1, time.monotonic())
        self._state = ()  # or it would hold the last take

    def take_finished(self, take: Take) -> None:
        """Take a motion when all of it is rendered, with its errors."""

    def show_moment(self, moment: Moment) -> None:
        """Show a moment while the panel is visible; every `every`-th is drawn.

        The panels of the stage get 60 a second, those of the decks 30, and all fewer at rest.
        """
        self.look()
        self._moments += 1
        if self._moments % self.every == 0:
            self._draw_moment(moment)

    def _draw_moment(self, moment: Moment) -> None:
        """Draw what has changed since the last moment."""

    def _is_new(self, *state: object) -> bool:
        """Return True if `state`, all that the picture depends on, is not that of the last call; keep it."""
        before, self._state = self._state, state
        return state != before

    def end(self) -> None:
        """End the panel's thread; called when the window closes."""
        self.background.close()

    def compute(self, work: Work, models_of: Iterable[PresetInfo] = ()) -> None:
        """Start a long job in place of the one under way; `background` has its signals.

        Args:
            work: is called with the job in the thread of `background`, and returns the result.
            models_of: presets whose models it runs. Those of many strings need no torch. For any other it is
                loaded, and kept to one core.
        """

        def on_one_core(job: Job) -> object:
            import torch  # noqa: F401 - whose OpenMP counts threads for each thread that computes

            with threadpool_limits(limits=1, user_api="openmp"):
                return work(job)

        self.look()
        self.background.start(work if all(info.of_many_strings for info in models_of) else on_one_core)

    def look(self) -> None:
        """Note that the panel is looked at; to be called while it is visible.

        UNSEEN_S after the last call jobs rest.
        """
        self._seen_s = time.monotonic()

    def solo(self, mode: int) -> None:
        """Solo a mode; all modes where it is soloed already, or 0."""
        self.session.update(solo=0 if mode == self.session.choices.solo else mode)

    def _rests(self) -> bool:
        """Return True if jobs rest: the panel is hidden, or a take is being rendered. Called in their thread."""
        now_s, take = time.monotonic(), self._growing
        if now_s - self._seen_s > UNSEEN_S:
            return True
        if take is None or take.complete:
            return False
        if take.ready_frames != self._grown[0]:
            self._grown = (take.ready_frames, now_s)
        return now_s - self._grown[1] <= GIVEN_UP_S  # else its rendering was abandoned, or failed


class ComputedPanel(Panel):
    """A line of words above a figure, which is computed once what it depends on was the same for `SETTLED_S`.

    Attributes:
        progress: the share that is computed.

    Args:
        failed: the words where it cannot be computed; "": they stay as they are.
    """

    SETTLED_S: ClassVar[float] = 0.0  # s

    def __init__(self, session: Session, library: Library, failed: str = "") -> None:
        super().__init__(session, library)
        self.setAccessibleName(self.title)
        self.setMinimumHeight(LEAST_HEIGHT)
        self._words = Readout()
        self._words.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        self.progress = ProgressStrip(f"Progress of the {self.title.lower()}")
        self._asked: object = None  # the latest value of `_wanted`; None: nothing is to be computed
        self._begun = False  # computing what is asked for
        self._unchanged_s = 0.0  # s for which it was the same, while the panel was shown
        if failed:
            self.background.failed.connect(lambda: self._say(failed))

    @property
    def words(self) -> str:
        return self._words.text()

    @abstractmethod
    def _wanted(self) -> object:
        """The values on which the figure depends; None: there is nothing to compute."""

    def _clear(self) -> None:
        """Take the old figure away, or mark it: another one is asked for. Do nothing by default."""

    @abstractmethod
    def _begin(self) -> None:
        """Begin to compute the figure."""

    def _say(self, words: str, share: float | None = None) -> None:
        """Write the words while nothing is pointed at, and show the share that is computed; None: nothing is."""
        self._words.rest(words)
        self.progress.show_share(share)

    def choices_changed(self, names: frozenset[str]) -> None:
        self._ask()

    def _ask(self) -> None:
        """Cancel the computation where another figure is wanted than was asked for; the new one begins later."""
        wanted = self._wanted()
        if wanted != self._asked:
            self._asked = wanted
            self._begun, self._unchanged_s = False, 0.0
            self.background.cancel()
            self._clear()

    def _draw_moment(self, moment: Moment) -> None:
        self._ask()
        self._unchanged_s += moment.elapsed_s
        if not self._begun and self._asked is not None and self._unchanged_s >= self.SETTLED_S:
            self._begun = True
            self._begin()


class StagePanel(Panel):
    """The picture of the string or the drum, above the decks; in Play of the audible source alone."""

    view: StageView

    def __init__(self, session: Session, library: Library, view: StageView) -> None:
        super().__init__(session, library)
        self.view = self.figure = view
        lay_out_alone(self, view)
        view.listening_point_moved.connect(self._move_listening_point)
        view.listening_point_reset.connect(self._reset_listening_point)
        view.motion_toggled.connect(lambda on: session.update(motion=on))

    @property
    def _sources(self) -> tuple[ShownSource, ...]:
        """The drawn sources: both slots, or in Play the audible one."""
        sources = shown_sources(self.session.choices, self.library)
        return tuple(source for source in sources if source.heard or self.session.choices.face != "play")

    def _warning(self) -> tuple[str, bool]:
        """The reason why nothing is heard, "" for none; and True if it is a warning, not a remark."""
        return why_silent(self.session.choices, self.library), True

    def choices_changed(self, names: frozenset[str]) -> None:
        """Show in the picture the sources, listening points and warning of the choices; `names`: as of `Panel`."""
        choices, view = self.session.choices, self.view
        if names & STAGE_FIELDS:
            view.set_plain(choices.face == "play")
            view.set_sources(self._sources)
            left, right = choices.listen, choices.listen_right if choices.stereo else None
            at_bridge = self.of_strings and choices.pickup.kind == "bridge"
            view.set_listening_points(*((None, None) if at_bridge else (left, right)))
            view.set_warning(*self._warning())
        if names & {"motion", "envelope"}:
            view.set_shown(choices.motion, choices.envelope)

    def _draw_moment(self, moment: Moment) -> None:
        choices = self.session.choices
        if not self._is_new(*moment.standing(choices)) and not moment.playing:
            return
        self.view.show_frame(self._frame(moment) if moment.in_motion(choices) else None)

    @abstractmethod
    def _frame(self, moment: Moment) -> object:
        """The string or the drum as it moves now; None: at rest."""

    def _move_listening_point(self, side: str, point: float) -> None:
        if side == "right":
            self.session.update(listen_right=point)
        else:
            self.session.move_listening_point(point)

    def _reset_listening_point(self, side: str) -> None:
        self._move_listening_point(side, Choices().listen_right if side == "right" else Choices().listen)
