"""The string in motion, the pluck that is being drawn, and why a pluck may be silent or beyond the training."""

from __future__ import annotations

from app.library import Library
from app.motion import Strobe, frame_at
from app.panels.base import Moment, Panel
from app.rendering import DIFFERENCE, Take
from app.session import Session
from app.silence import why_difference_silent, why_silent
from app.views.string_view import StringView
from engine.metrics import ErrorSums
from engine.preset import outside_training

MM = 1000.0
PLUCK_FIELDS = {"position", "amplitude_mm", "shape", "width", "preset"}
HEARING_FIELDS = {"listen", "listen_right", "stereo", "pickup", "solo", "a", "b", "heard", "volume_db"}
WARNING_FIELDS = PLUCK_FIELDS | HEARING_FIELDS | {"difference_gain_db"}


class StringPanel(Panel):
    key = "string"
    title = "String"
    view: StringView

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library)
        self.view = StringView()
        self.view.pluck_drawn.connect(session.move_pluck)
        self.view.pluck_released.connect(self.pluck_asked)
        self.view.listening_point_moved.connect(session.move_listening_point)
        self._strobe = Strobe()
        self._take: Take | None = None  # the complete one of this pluck

    @property
    def drawing(self) -> bool:
        """Whether the string is held in the hand and not yet let go."""
        return self.view.is_dragging_pluck

    def choices_changed(self, names: frozenset[str]) -> None:
        if names & PLUCK_FIELDS:
            self._take = None
        if names & WARNING_FIELDS:
            self._show_pluck()
        if names & {"heard", "a", "b"}:
            self.view.set_heard(self.session.source_heard)

    def take_started(self, take: Take) -> None:
        self._strobe.restart()

    def take_finished(self, take: Take, errors: ErrorSums) -> None:
        self._take = take
        self.view.set_warning(self._pluck_warning())

    def show_moment(self, moment: Moment) -> None:
        take, position_s, speed = moment.take, moment.position_s, self.session.choices.speed
        if take is None or not (moment.playing or position_s > 0):
            self.view.show_frame(None)
            return
        self._strobe.advance(moment.elapsed_s if moment.playing else 0.0, speed, take.fundamental_hz)
        shown_s = self._strobe.time_s(position_s, take.fundamental_hz)
        self.view.show_frame(frame_at(take, position_s, shown_s, speed))

    def _show_pluck(self) -> None:
        choices, entry, view = self.session.choices, self.library.find(self.session.choices.preset), self.view
        points = entry.info.grid_points if entry else 101
        view.set_pluck(choices.position, choices.amplitude_mm, choices.pluck.displacement(points).numpy() * MM)
        view.set_listening_point(choices.listen, choices.listen_right if choices.stereo else None)
        view.set_trained_positions(entry.info.trained_range.position if entry else None)
        view.set_warning(self._pluck_warning())

    def _pluck_warning(self) -> str:
        choices, entry = self.session.choices, self.library.find(self.session.choices.preset)
        silent = why_silent(choices, self.library)
        if not silent and choices.source_heard == DIFFERENCE and self._take is not None:
            silent = why_difference_silent(choices, self._take)
        if silent:
            return silent
        return "; ".join(outside_training(entry.info, choices.pluck)) if entry else ""
