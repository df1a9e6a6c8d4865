"""The whole string over time, as colours: the motion of a source, or the error."""

from __future__ import annotations

from app.analysis.space_time import Envelopes, Picture, picture
from app.presets.library import Library
from app.rendering import SOURCES, Take
from app.session.choices import Session
from app.views.plots.space_time_view import SpaceTimeView
from app.window.panels.base import Moment, Panel
from app.window.panels.follower import Follower

MM = 1000.0
EVERY = 3  # moments


class SpaceTimePanel(Panel):
    key = "space_time"
    title = "Space–time"
    help = (
        "Displacement of model or truth, or the error between them, over time (across) and position on the string "
        "(up). A click moves the playhead, with Shift the listening point too."
    )
    view: SpaceTimeView

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library)
        self.view = SpaceTimeView()
        self.view.plot.seek_asked.connect(self.seek_asked)
        self.view.plot.hovered.connect(self._tell)
        self.view.listening_point_moved.connect(session.move_listening_point)
        self._follower = Follower("space-time", self.told.emit)
        self._envelopes: Envelopes | None = None
        self._moments = 0
        self._shown: tuple[object, ...] = ()
        self._picture: Picture | None = None

    def choices_changed(self, names: frozenset[str]) -> None:
        if "listen" in names:
            self.view.set_listening_point(self.session.choices.listen)

    def take_started(self, take: Take) -> None:
        self._follower.follow(None)
        self._envelopes = None  # begun when the panel is visible
        self._shown, self._picture = (), None  # which would hold the last take
        self.view.set_take(take.seconds, take.info.horizon_s, take.pluck.amplitude_mm)

    def show_moment(self, moment: Moment) -> None:
        self.view.plot.show_playhead(moment.position_s)
        self._moments += 1
        if moment.take is None or self._moments % EVERY:
            return
        if self._envelopes is None:
            self._envelopes = Envelopes(moment.take)
            self._follower.follow(self._envelopes)
        self._show(self._envelopes)

    def close(self) -> None:
        self._follower.close()

    def _show(self, envelopes: Envelopes) -> None:
        view = self.view
        times_s, columns = view.plot.times_s, view.plot.columns
        shown = (envelopes, envelopes.take.ready_frames, envelopes.ready, view.quantity, times_s, columns)
        if shown == self._shown:
            return
        self._shown = shown
        self._picture = made = picture(envelopes, view.quantity, times_s, columns)
        if made is None:
            view.show_nothing()
            return
        typical_mm = self._typical_mm(envelopes, times_s)
        view.show_picture(made.displacement_m * MM, made.start_s, made.stop_s, typical_mm, made.signed)
        view.readout.rest(_caption(made))

    def _typical_mm(self, envelopes: Envelopes, times_s: tuple[float, float]) -> float:
        """The typical displacement in view, the same for model and truth, or the typical error."""
        names = ("error",) if self.view.quantity == "error" else SOURCES
        return max(envelopes.typical_m(name, times_s) for name in names) * MM

    def _tell(self, time_s: float, place: float) -> None:
        here_m = self._picture.at(time_s, place) if self._picture is not None else None
        if here_m is None:
            self.view.readout.tell("")
        else:
            self.view.tell(time_s, place, here_m * MM)


def _caption(made: Picture) -> str:
    column_ms = 1000 * (made.stop_s - made.start_s) / made.displacement_m.shape[1]
    return {
        "frames": "every frame",
        "extremes": f"extremes of {column_ms:.2g} ms",
        "envelope": f"peaks of {column_ms:.2g} ms, without sign; zoom in for motion",
    }[made.detail]
