"""The waveform of the whole take at the listening point."""

from __future__ import annotations

import numpy as np

from app.library import Library
from app.panels.base import Moment, Panel
from app.rendering import SOURCES, Take
from app.session import Session
from app.views.waveform_view import WaveformView

MM = 1000.0
EVERY = 3  # moments


class WaveformPanel(Panel):
    key = "waveform"
    title = "Waveform"
    view: WaveformView

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library)
        self.view = WaveformView()
        self.view.seek_asked.connect(self.seek_asked)
        self.view.getPlotItem().sigXRangeChanged.connect(self._redraw)
        self._take: Take | None = None
        self._moments = 0
        self._shown: tuple[object, ...] = ()

    def choices_changed(self, names: frozenset[str]) -> None:
        if names & {"heard", "a", "b"}:
            self.view.set_heard(self.session.source_heard)

    def take_started(self, take: Take) -> None:
        self._take = take
        peak_mm = max(1e-3, float(np.abs(take.signal_m("truth", self.session.choices.listen)).max()) * MM)
        self.view.set_take(take.seconds, take.info.horizon_s, 1.25 * peak_mm)

    def show_moment(self, moment: Moment) -> None:
        self.view.show_playhead(moment.position_s)
        self._moments += 1
        if self._moments % EVERY == 0 and self._take is not None:
            shown = (self._take, self._take.ready_frames, self.session.choices.listen)
            if shown != self._shown:
                self._shown = shown
                self._redraw()

    def _redraw(self) -> None:
        take = self._take
        if take is not None:
            signals = {name: take.signal_m(name, self.session.choices.listen) * MM for name in SOURCES}
            self.view.show_signals(signals, take.info.rate_hz)
