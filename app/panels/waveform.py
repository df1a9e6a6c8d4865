"""The waveform of the whole take at the listening point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from app.library import Library
from app.panels.base import Moment, Panel
from app.rendering import SOURCES, Take
from app.session import Session
from app.views.waveform_view import WaveformView

MM = 1000.0
EVERY = 3  # moments
MOST_FRAMES = 65_536  # at a time: what is new after the listening point has moved comes in a few steps


class WaveformPanel(Panel):
    key = "waveform"
    title = "Waveform"
    help = (
        "The displacement at the listening point over the whole pluck. Click to move the playhead; the wheel "
        "zooms. Behind the red line the model goes on without training."
    )
    view: WaveformView

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library)
        self.view = WaveformView()
        self.view.seek_asked.connect(self.seek_asked)
        self._take: Take | None = None
        self._listen = 0.0
        self._signals_mm: dict[str, NDArray[np.float32]] = {}
        self._ready = 0  # frames of them
        self._moments = 0
        self._shown: tuple[object, ...] = ()

    def choices_changed(self, names: frozenset[str]) -> None:
        if names & {"heard", "a", "b"}:
            self.view.set_heard(self.session.source_heard)

    def take_started(self, take: Take) -> None:
        self._shown = ()  # holds nothing of the last take
        listen = self.session.choices.listen
        peak_mm = max(1e-3, float(np.abs(take.signal_m("truth", listen)).max()) * MM)
        self.view.set_take(take.seconds, take.info.horizon_s, 1.25 * peak_mm)
        self._begin(take, listen)

    def show_moment(self, moment: Moment) -> None:
        self.view.show_playhead(moment.position_s)
        self._moments += 1
        take, listen = self._take, self.session.choices.listen
        if take is None or self._moments % EVERY:
            return
        if listen != self._listen:
            self._begin(take, listen)
        self._catch_up(take)
        shown = (take, self._ready, listen, self.view.times_s)
        if shown != self._shown:
            self._shown = shown
            signals_mm = {name: signal[: self._ready] for name, signal in self._signals_mm.items()}
            self.view.show_signals(signals_mm, take.info.rate_hz)

    def _begin(self, take: Take, listen: float) -> None:
        self._take, self._listen, self._ready = take, listen, 0
        self._signals_mm = {name: np.empty(take.frames, np.float32) for name in SOURCES}

    def _catch_up(self, take: Take) -> None:
        start, stop = self._ready, min(take.ready_frames, self._ready + MOST_FRAMES)
        for name, signal in self._signals_mm.items():
            signal[start:stop] = take.signal_m(name, self._listen, start, stop) * MM
        self._ready = stop
