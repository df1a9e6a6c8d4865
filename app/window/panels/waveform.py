"""What the slots hold over the whole take, as it is heard at the listening point."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from app.analysis.heard import HeardSignal
from app.presets.library import Library
from app.rendering import Take
from app.session.choices import Session
from app.session.shown import LEGEND_FIELDS, part_words, readable_unit, shown_sources
from app.views.plots.waveform_view import WaveformView
from app.window.panels.base import Moment, Panel

EVERY = 2  # moments
MOST_FRAMES = 262_144  # read in one call, which takes a millisecond
AIR = 1.25  # how much higher the axis is than the peak
FLAT = 2e-7  # m or m/s: the axis of silence, so that rounding is not magnified to a sound


@dataclass
class _Drawn:
    """A signal as far as it has been read."""

    heard: HeardSignal
    signal: NDArray[np.float32] = field(init=False)
    ready: int = 0
    peak: float = 0.0

    def __post_init__(self) -> None:
        self.signal = np.empty(self.heard.frames, np.float32)

    def catch_up(self) -> bool:
        """Reads on, MOST_FRAMES at most; whether there was something to read."""
        new = self.heard.read(self.ready, self.ready + MOST_FRAMES)
        self.signal[self.ready : self.ready + len(new)] = new
        self.ready += len(new)
        self.peak = max(self.peak, float(np.abs(new).max(initial=0.0)))
        return len(new) > 0


class WaveformPanel(Panel):
    key = "waveform"
    title = "Waveform"
    help = (
        "The pick-up's signal at the listening point over the whole pluck, of slots A and B: displacement or "
        "velocity, all modes or one. A click moves the playhead; the wheel zooms. After the red line, the end of the "
        "trained time, the model extrapolates."
    )
    view: WaveformView

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library)
        self.view = WaveformView()
        self.view.seek_asked.connect(self.seek_asked)
        self._take: Take | None = None
        self._drawn: dict[str, _Drawn] = {}
        self._full = 0.0  # of the axis, in m or m/s
        self._caught_up: tuple[object, ...] = ()  # progress of the take and choices when all was read
        self._moments = 0
        self._shown: tuple[object, ...] = ()

    def choices_changed(self, names: frozenset[str]) -> None:
        if names & LEGEND_FIELDS:
            choices = self.session.choices
            self.view.set_sources(shown_sources(choices, self.library), part_words(choices))
            self._shown = ()

    def take_started(self, take: Take) -> None:
        self._take, self._drawn, self._full = take, {}, 0.0
        self._shown = self._caught_up = ()  # which would hold the last take
        self.view.set_take(take.seconds, take.info.horizon_s, 1 / take.fundamental_hz)

    def show_moment(self, moment: Moment) -> None:
        self.view.show_playhead(moment.position_s)
        self._moments += 1
        take = self._take
        if take is None or self._moments % EVERY:
            return
        choices = self.session.choices
        there = take.progress, choices
        if there != self._caught_up:
            self._caught_up = () if self._follow(take) else there
        ready = {name: drawn.ready for name, drawn in self._drawn.items()}
        shown = (take.listened, ready, self.view.times_s, self.view.columns)
        if shown != self._shown:
            self._shown = shown
            self._draw()

    def _follow(self, take: Take) -> bool:
        """Reads on what the slots hold; a signal that is new from its start.

        Whether there was anything to read: there may be more.
        """
        choices, moved = self.session.choices, False
        before, self._drawn = self._drawn, {}
        for source in shown_sources(choices, self.library):
            heard, known = HeardSignal(take.listened, source.source, source.gain), before.get(source.source)
            if not heard.there:
                continue  # another preset's model, not yet rendered
            drawn = known if known is not None and known.heard == heard else _Drawn(heard)
            moved |= drawn.catch_up()
            self._drawn[source.source] = drawn
        if any(self._drawn.get(name) is not drawn for name, drawn in before.items()):
            self._full = 0.0  # something else is drawn: its own scale
        return moved

    def _draw(self) -> None:
        choices, view = self.session.choices, self.view
        assert self._take is not None
        pickup = self._take.listened.ear.pickup
        peak = max((drawn.peak for drawn in self._drawn.values()), default=0.0)
        if peak > self._full or self._full == 0.0:
            self._full = max(AIR * peak, FLAT)
        factor, unit = readable_unit(self._full, pickup)
        view.set_scale(factor * self._full, pickup, unit)
        for source in shown_sources(choices, self.library):
            if source.source in self._drawn:
                drawn = self._drawn[source.source]
                view.show_signal(source.source, np.float32(factor) * drawn.signal[: drawn.ready], drawn.heard.rate_hz)
            else:
                view.clear_signal(source.source)
