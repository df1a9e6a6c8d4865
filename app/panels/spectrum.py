"""The spectrum at the playhead, twenty times a second."""

from __future__ import annotations

from app.library import Library
from app.panels.base import Moment, Panel
from app.rendering import SOURCES, Take
from app.session import Session
from app.views.spectrum_view import SpectrumView
from engine.sources import FULL_SCALE_M

EVERY = 3  # moments


class SpectrumPanel(Panel):
    key = "spectrum"
    title = "Spectrum"
    view: SpectrumView

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library)
        self.view = SpectrumView()
        self._moments = 0
        self._shown: tuple[object, ...] = ()

    def choices_changed(self, names: frozenset[str]) -> None:
        if names & {"heard", "a", "b"}:
            self.view.set_heard(self.session.source_heard)

    def take_started(self, take: Take) -> None:
        if take.info.rate_hz != self.view.analyser.rate_hz:
            self.view.set_rate(take.info.rate_hz)

    def show_moment(self, moment: Moment) -> None:
        self._moments += 1
        take = moment.take
        if take is None or self._moments % EVERY:
            return
        listen = self.session.choices.listen
        shown = (take, -1 if take.complete else take.ready_frames, moment.position_s, listen)
        if shown == self._shown:
            return
        self._shown = shown
        first = round(moment.position_s * take.info.rate_hz)
        last = first + self.view.analyser.window_frames
        self.view.show_signals({name: take.signal_m(name, listen, first, last) / FULL_SCALE_M for name in SOURCES})
