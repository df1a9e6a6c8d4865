"""The error of this pluck over time, as it is rendered."""

from __future__ import annotations

import math

from app.analysis.error_course import ErrorCourse
from app.presets.library import Library
from app.rendering import Take
from app.session.choices import Session
from app.views.plots.error_time_view import LONG_S, ErrorTimeView, percent
from app.window.panels.base import Moment, Panel
from app.window.panels.follower import Follower

EVERY = 3  # moments


class ErrorTimePanel(Panel):
    key = "error_time"
    title = "Error over time"
    help = (
        "The model's error relative to the truth in windows of two periods, within the trained time and past it. "
        "One button renders ten seconds."
    )
    view: ErrorTimeView

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library)
        self.view = ErrorTimeView()
        self.view.plot.seek_asked.connect(self.seek_asked)
        self.view.plot.hovered.connect(self._tell)
        self.view.longer_asked.connect(lambda: session.update(seconds=LONG_S))
        self._follower = Follower("error-course", self.told.emit)
        self._course: ErrorCourse | None = None
        self._shown: tuple[object, ...] = ()
        self._moments = 0

    def choices_changed(self, names: frozenset[str]) -> None:
        if "seconds" in names:
            self.view.set_seconds(self.session.choices.seconds)

    def take_started(self, take: Take) -> None:
        self._follower.follow(None)
        self._course = None  # begun when the panel is visible
        self._shown = ()  # which would hold the last take
        stored = {
            "rmse": None if take.info.rel_mse is None else math.sqrt(take.info.rel_mse),
            "mae": take.info.rel_mae,
        }
        known = {name: error for name, error in stored.items() if error is not None}
        self.view.set_take(take.seconds, take.info.horizon_s, known)

    def show_moment(self, moment: Moment) -> None:
        self.view.plot.show_playhead(moment.position_s)
        self._moments += 1
        if moment.take is None or self._moments % EVERY:
            return
        if self._course is None:
            self._course = ErrorCourse(moment.take)
            self._follower.follow(self._course)
        course = self._course
        ready = course.ready
        shown = (course, ready, self.view.quantity)
        if ready and shown != self._shown:
            self._shown = shown
            curves = {name: values[:ready] for name, values in course.curves.items()}
            self.view.show_curves(course.middle_s[:ready], curves)

    def close(self) -> None:
        self._follower.close()

    def _tell(self, time_s: float, _: float) -> None:
        text, course = "", self._course
        if course is not None and math.isfinite(time_s):
            window = int(time_s / course.window_s)
            if 0 <= window < course.ready:
                here = {name: values[window] for name, values in course.curves.items()}
                text = f"{course.middle_s[window]:.3f} s   "
                if self.view.quantity == "level":
                    text += f"{here['level_db']:+.2f} dB" if math.isfinite(here["level_db"]) else "silent"
                else:
                    text += f"RMSE {percent(here['rmse'])}   MAE {percent(here['mae'])}"
        self.view.readout.tell(text)
