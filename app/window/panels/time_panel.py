"""A panel over the time of a take, which shows what is computed as the take grows."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable
from functools import partial
from typing import Generic, Protocol, TypeVar

from PySide6.QtWidgets import QWidget

from app.presets.library import Library
from app.rendering import BlowTake, Sounding, Take
from app.shared.worker import Job
from app.stage.session import Session
from app.views.controls.elided_label import Readout
from app.views.controls.parts import lay_out_view
from app.views.plots.time_plot import TimePlot
from app.window.panels.base import Moment, Panel

G = TypeVar("G")
LOOK_AGAIN_S = 0.03  # while a take has nothing new


class Growing(Protocol):
    """Results of which the first so many are ready and never change: one thread calls `advance`, any thread reads."""

    @property
    def complete(self) -> bool:
        """Return True if all results are ready."""

    def advance(self) -> bool:
        """Compute the next few results; return False where the take has nothing new for them yet."""


def keep_up(growing: Growing, job: Job) -> None:
    """Compute all results as the take grows. Raises Cancelled: they are no longer wanted."""
    while not growing.complete:
        job.wait(0.0 if growing.advance() else LOOK_AGAIN_S)


class TimePanel(Panel, Generic[G]):
    """Small controls and a readout above a plot over time. What is computed is begun when the panel is visible.

    `G` is the type of what a subclass computes from a take, its figures: numbers that are ready as far as rendered.
    """

    every = 3  # 10 pictures a second

    def __init__(self, session: Session, library: Library, plot: TimePlot) -> None:
        super().__init__(session, library)
        self.plot = self.figure = plot
        self.readout = Readout()
        self.plot.seek_asked.connect(self.seek_asked)
        self.plot.hovered.connect(self._hover)
        self._made: G | None = None  # the figures of the shown take; None: not begun

    def _lay_out(self, *controls: QWidget) -> None:
        lay_out_view(self, controls, self.readout, (), self.plot, gap=0)

    @abstractmethod
    def _begin(self, take: Sounding) -> G:
        """Begin what is to be computed from a take, or from a blow where the panel draws drums."""

    def _keep_up(self, figures: Growing) -> None:
        """Compute figures as their take grows, in the background."""
        self.background.start(partial(keep_up, figures))

    @abstractmethod
    def _draw(self, figures: G) -> None:
        """Draw the figures as far as they are ready."""

    @abstractmethod
    def _words(self, figures: G, time_s: float, place: float) -> Iterable[str]:
        """The words for a point of the plot, in one or more wordings, the longest first; none where nothing is.

        Args:
            time_s: from the pluck or blow.
            place: on the vertical axis, in the plot's own units.
        """

    def _is_of(self, figures: G, take: Sounding) -> bool:
        """Return True if figures are of the take as it is heard now; else they are begun again."""
        return True

    def take_started(self, take: Take | BlowTake) -> None:
        """Discard what was computed of the take before."""
        super().take_started(take)
        self.background.cancel()
        self._made = None
        self.plot.set_times(take.seconds, take.horizon_s)

    def show_moment(self, moment: Moment) -> None:
        self.plot.show_playhead(moment.position_s)
        super().show_moment(moment)

    def _draw_moment(self, moment: Moment) -> None:
        """Draw the figures of the moment's take, begun here where there are none of it yet."""
        take = moment.take if self.of_strings else moment.sounding
        if take is None:
            return
        figures = self._made
        if figures is None or not self._is_of(figures, take):
            self._made = figures = self._begin(take)
        self._draw(figures)

    def _hover(self, time_s: float, place: float) -> None:
        figures = self._made
        wordings = [] if figures is None or not math.isfinite(time_s) else [*self._words(figures, time_s, place)]
        self.readout.report(*(wordings or ("",)))
