"""The eigenvalues that the chosen preset learned, beside those of its string."""

from __future__ import annotations

from app.analysis.job import Job
from app.analysis.poles import PoleFigure, pole_figure
from app.playing.chosen import subject_of
from app.presets.library import Library
from app.rendering.subject import Subject, load_subject
from app.session.choices import Session
from app.views.plots.eigenvalues_view import EigenvaluesView
from app.window.panels._background import Background
from app.window.panels.base import Moment, Panel


class EigenvaluesPanel(Panel):
    key = "eigenvalues"
    title = "Eigenvalues"
    help = (
        "The model's learned eigenvalues beside the string's own: as frequency and T60, or on the complex "
        "plane. A click solos that mode, Esc plays all modes."
    )
    view: EigenvaluesView

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library)
        self.view = EigenvaluesView()
        self.view.mode_chosen.connect(self._choose)
        self.view.solo_ended.connect(lambda: session.update(solo=0))
        self._asked: Subject | None = None
        self._background = Background("eigenvalues", self)
        self._background.finished.connect(self.view.show_figure)
        self._background.failed.connect(self._failed)

    def choices_changed(self, names: frozenset[str]) -> None:
        if "solo" in names:
            self.view.set_solo(self.session.choices.solo)

    def show_moment(self, moment: Moment) -> None:
        entry = self.library.find(self.session.choices.preset)
        if entry is None or (moment.playing and self._asked is not None):  # keys may change it many times a second
            return
        subject = subject_of(self.session.choices, entry.path)
        if subject != self._asked:
            self._asked = subject
            self.view.show_figure(None, "Reading the preset …")

            def work(job: Job) -> PoleFigure:
                return pole_figure(load_subject(subject))

            self._background.start(work)

    def close(self) -> None:
        self._background.close()

    def _choose(self, mode: int) -> None:
        self.session.update(solo=0 if mode == self.session.choices.solo else mode)

    def _failed(self, message: str, details: str) -> None:
        self.view.show_figure(None, "This preset cannot be read")
        self.told.emit(message, details)
