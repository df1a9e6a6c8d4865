"""The partials of the present take, measured once it is complete; until then those of the last one are grey."""

from __future__ import annotations

from app.analysis.take_partials import WINDOWS, PartialRow, take_partials
from app.presets.library import Library
from app.rendering import Take
from app.session.choices import Session
from app.views.plots.partials_view import PartialsView
from app.window.panels._background import Background
from app.window.panels.base import Moment, Panel
from engine.metrics import ErrorSums


class PartialsPanel(Panel):
    key = "partials"
    title = "Partials"
    help = (
        "Every mode of the string: frequency, decay and level, model against truth. A click on a row solos its mode, "
        "Esc plays all modes."
    )
    view: PartialsView

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library)
        self.view = PartialsView()
        self.view.window_chosen.connect(lambda _: self._show())
        self.view.mode_chosen.connect(self._choose)
        self.view.solo_ended.connect(lambda: session.update(solo=0))
        self._waiting: Take | None = None  # complete, and not yet measured
        self._rows: dict[str, list[PartialRow]] | None = None
        self._background = Background("partials", self)
        self._background.progressed.connect(lambda share, _: self.view.progress.show_share(share))
        self._background.finished.connect(self._measured)
        self._background.failed.connect(self._failed)

    def choices_changed(self, names: frozenset[str]) -> None:
        if "solo" in names:
            self.view.show_solo(self.session.choices.solo)

    def take_started(self, take: Take) -> None:
        self._waiting = self._rows = None
        self._background.cancel()
        self.view.dim()
        self.view.progress.show_share(None)
        self.view.set_words("The partials of the new pluck follow when it is rendered")

    def take_finished(self, take: Take, errors: ErrorSums) -> None:
        self._waiting = take

    def show_moment(self, moment: Moment) -> None:
        self._background.look()
        if self._waiting is not None:  # measured only while the panel is visible
            take, self._waiting = self._waiting, None
            self.view.progress.show_share(0.0)
            self.view.set_words("Measuring the partials of this pluck …")
            self._background.start(lambda job: take_partials(take, job))

    def close(self) -> None:
        self._background.close()

    def _choose(self, mode: int) -> None:
        self.session.update(solo=0 if mode == self.session.choices.solo else mode)
        self.view.show_solo(self.session.choices.solo)

    def _measured(self, rows: dict[str, list[PartialRow]]) -> None:
        self.view.progress.show_share(None)
        self._rows = rows
        self._show()

    def _failed(self, message: str, details: str) -> None:
        self.view.progress.show_share(None)
        self.view.set_words("The partials of this pluck could not be measured")
        self.told.emit(message, details)

    def _show(self) -> None:
        if self._rows is None:
            return
        window = self.view.window_key
        rows = self._rows.get(window, [])
        self.view.show_partials(rows)
        self.view.show_solo(self.session.choices.solo)
        self.view.set_words(
            "" if rows else f"{WINDOWS[window].capitalize()}: too short to measure; increase the duration"
        )
