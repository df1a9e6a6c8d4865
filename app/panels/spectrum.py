"""The spectrum at the playhead, fifteen times a second."""

from __future__ import annotations

import math

import numpy as np

from app.library import Library
from app.panels.base import Moment, Panel
from app.rendering import SOURCES, Take
from app.session import Session
from app.views.spectrum_view import SpectrumView
from engine.sources import FULL_SCALE_M

EVERY = 4  # moments


class SpectrumPanel(Panel):
    key = "spectrum"
    title = "Spectrum"
    help = (
        "Level against frequency at the playhead and the listening point, of model and truth on the same "
        "axes; 0 dB is a full-scale sine. A partial that is out of tune or decays wrongly parts here first."
    )
    view: SpectrumView

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library)
        self.view = SpectrumView()
        self._moments = 0
        self._shown: tuple[object, ...] = ()
        self._partials_hz = np.zeros(0)
        self._hovered_hz = math.nan
        self.view.hovered.connect(self._hover)

    def choices_changed(self, names: frozenset[str]) -> None:
        if names & {"heard", "a", "b"}:
            self.view.set_heard(self.session.source_heard)

    def take_started(self, take: Take) -> None:
        self._shown = ()  # holds nothing of the last take
        if take.info.rate_hz != self.view.analyser.rate_hz:
            self.view.set_rate(take.info.rate_hz)
        self._partials_hz = take.info.string.undamped_frequencies(take.info.modes).numpy() / (2 * np.pi)

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
        if math.isfinite(self._hovered_hz):
            self._tell()

    def _hover(self, frequency_hz: float) -> None:
        self._hovered_hz = frequency_hz
        if math.isfinite(frequency_hz):
            self._tell()
        else:
            self.view.show_readout("")

    def _tell(self) -> None:
        """The frequency under the mouse, its levels, and the nearest partial of the string at rest."""
        frequency_hz, partial_hz = self._hovered_hz, None
        levels = "  ".join(f"{name} {level:.1f}" for name, level in self.view.levels_db(frequency_hz).items())
        text = f"{frequency_hz:.1f} Hz   {levels} dB"
        if len(self._partials_hz):
            nearest = int(np.abs(np.log(self._partials_hz / frequency_hz)).argmin())
            partial_hz = float(self._partials_hz[nearest])
            cents = 1200 * math.log2(frequency_hz / partial_hz)
            text += f"   partial {nearest + 1}: {partial_hz:.1f} Hz ({cents:+.0f} cents)"
        self.view.show_readout(text, partial_hz)
