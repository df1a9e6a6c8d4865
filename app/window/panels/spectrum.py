"""The spectrum of what the slots hold, as it is heard at the playhead."""

from __future__ import annotations

import math

import numpy as np

from app.analysis.heard import HeardSignal
from app.presets.library import Library
from app.rendering import Take
from app.session.choices import Session
from app.session.shown import LEGEND_FIELDS, full_scale_words, part_words, shown_sources
from app.views.plots.spectrum_view import SpectrumView, analyser_at
from app.window.panels.base import Moment, Panel

EVERY = 2  # moments


class SpectrumPanel(Panel):
    key = "spectrum"
    title = "Spectrum"
    help = (
        "Level against frequency of what slots A and B hold, at the playhead and the listening point, on the same "
        "axes; 0 dB is a sine of the amplitude that the axis names. Here a partial that is out of tune or decays "
        "wrongly is seen first."
    )
    view: SpectrumView

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library)
        self.view = SpectrumView()
        self._moments = 0
        self._standing: tuple[object, ...] = ()
        self._shown: tuple[object, ...] = ()
        self._partials_hz = np.zeros(0)
        self._hovered_hz = math.nan
        self.view.hovered.connect(self._hover)

    def choices_changed(self, names: frozenset[str]) -> None:
        choices = self.session.choices
        if names & LEGEND_FIELDS:
            self.view.set_sources(shown_sources(choices, self.library), part_words(choices))
            self._shown = ()
        if "pickup" in names:
            self.view.set_full_scale(full_scale_words(choices))

    def take_started(self, take: Take) -> None:
        self._shown = self._standing = ()  # which would hold the last take
        self._partials_hz = take.info.resonator.omega.numpy() / (2 * np.pi)

    def show_moment(self, moment: Moment) -> None:
        self._moments += 1
        take, choices = moment.take, self.session.choices
        if take is None or self._moments % EVERY:
            return
        standing = moment.standing(choices)
        if standing == self._standing:
            return
        self._standing = standing
        signals = [HeardSignal(take.listened, s.source, s.gain) for s in shown_sources(choices, self.library)]
        there = [signal for signal in signals if signal.there]
        ready = tuple(-1 if signal.ready == signal.frames else signal.ready for signal in there)
        shown = (take.listened, ready, moment.position_s)
        if shown == self._shown:
            return
        self._shown = shown
        self.view.set_rate(max((signal.rate_hz for signal in there), default=take.info.rate_hz))
        for signal in signals:
            if signal in there:
                self._draw(signal, moment.position_s)
            else:
                self.view.clear_signal(signal.source)
        if math.isfinite(self._hovered_hz):
            self._tell()

    def _draw(self, heard: HeardSignal, position_s: float) -> None:
        analyser = analyser_at(heard.rate_hz)
        last_window = heard.ready - analyser.window_frames  # the window does not pass the end of the signal
        first = max(0, min(round(position_s * analyser.rate_hz), last_window))
        signal = heard.read(first, first + analyser.window_frames) / heard.listened.ear.full_scale
        self.view.show_signal(heard.source, signal, analyser)

    def _hover(self, frequency_hz: float) -> None:
        self._hovered_hz = frequency_hz
        if math.isfinite(frequency_hz):
            self._tell()
        else:
            self.view.show_readout("")

    def _tell(self) -> None:
        """Writes the frequency under the mouse, its levels, and the nearest partial of a quiet pluck."""
        frequency_hz, partial_hz = self._hovered_hz, None
        levels_db = self.view.levels_db(frequency_hz)
        told = [s for s in shown_sources(self.session.choices, self.library) if s.source in levels_db]
        levels = "   ".join(f"{source.slots} {levels_db[source.source]:.1f} dB" for source in told)
        text = f"{frequency_hz:.1f} Hz   {levels}"
        if len(self._partials_hz):
            nearest = int(np.abs(np.log(self._partials_hz / frequency_hz)).argmin())
            partial_hz = float(self._partials_hz[nearest])
            cents = 1200 * math.log2(frequency_hz / partial_hz)
            text += f"   partial {nearest + 1}: {partial_hz:.1f} Hz ({cents:+.0f} cents)"
        self.view.show_readout(text, partial_hz)
