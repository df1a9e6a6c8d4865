"""The waveforms of the slots over the whole take, as heard at the listening point."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.analysis.heard import HeardSignal
from app.export.columns import Columns, aligned
from app.presets.library import Library
from app.rendering import BlowTake, Sounding, Take
from app.session.shown import readable_unit, shown_sources, unit_of
from app.stage.session import Session
from app.views.controls.parts import lay_out_alone
from app.views.plots.time_plot import TimePlot
from app.window.panels.base import Moment
from app.window.panels.curves import CurvesPanel

MOST_FRAMES = 262_144  # read in one call, which takes a millisecond
AIR = 1.25  # how much higher the axis is than the peak
FLAT = 2e-7  # m or m/s: the axis of silence, so that rounding is not magnified to a sound
FEW_PIXELS = 4


@dataclass
class _Drawn:
    """A signal as far as it has been read."""

    origin: HeardSignal
    ready: int = 0  # frames read so far
    peak: float = 0.0  # largest magnitude of these, in m or m/s

    def catch_up(self) -> bool:
        """Read the next MOST_FRAMES at most; return True if there were any."""
        new = self.origin.read(self.ready, self.ready + MOST_FRAMES)
        self.ready += len(new)
        self.peak = max(self.peak, float(np.abs(new).max(initial=0.0)))
        return len(new) > 0


class WaveformPanel(CurvesPanel):
    faint_alpha = 130
    key = "waveform"
    title = "Waveform"
    help = (
        "The pick-up's signal at the listening point over the whole pluck, of slots A and B: displacement or "
        "velocity, all modes or one. A click moves the playhead; the wheel zooms. After the red line, the end of the "
        "trained time, the model extrapolates."
    )

    def __init__(self, session: Session, library: Library) -> None:
        tip = (
            "Signal of the pick-up. Click moves the playhead; the wheel zooms in time, the right button pans;\n"
            "double-click shows all. Arrow keys move the playhead, + and − zoom"
        )
        super().__init__(session, library, TimePlot("Waveform", tip))
        self.plot.seek_asked.connect(self.seek_asked)
        self.plot.horizon.label.setPosition(0.1)  # the legend has the upper edge
        self._take: Sounding | None = None  # the shown take
        self._period_s = 0.0  # of the take's fundamental; 0: no take yet
        self._drawn: dict[str, _Drawn] = {}  # by source
        self._full = 0.0  # the end of the vertical axis, in m or m/s; 0: not known yet
        self.set_scale(5.0, "displacement", "mm")
        lay_out_alone(self, self.plot)

    def take_started(self, take: Take | BlowTake) -> None:
        super().take_started(take)
        self._take = take
        self._drawn = {}
        self._full = 0.0
        self._period_s = 1 / take.fundamental_hz
        self.plot.set_times(take.seconds, take.horizon_s)
        for curve in self._curves.values():
            curve.setData([], [])

    def show_moment(self, moment: Moment) -> None:
        self.plot.show_playhead(moment.position_s)
        super().show_moment(moment)

    def _draw_moment(self, moment: Moment) -> None:
        """Read on and draw, where more is rendered, or sources or view have changed."""
        take = self._take
        if take is None:
            return
        if self._is_new(take.listened, take.progress, self.session.choices, self.plot.times_s, self.plot.columns):
            if self._follow(take):
                self._state = ()  # there may be more to read
            self._draw(take)

    def _follow(self, take: Sounding) -> bool:
        """Read the next frames of the signals in the slots; of a new signal the first ones.

        Return True if there were any: there may be more.
        """
        choices, has_grown = self.session.choices, False
        before, self._drawn = self._drawn, {}
        for source in shown_sources(choices, self.library):
            origin = HeardSignal(take.listened.signals, source.source, source.gain)
            earlier = before.get(source.source)
            if not origin.there:
                continue  # another preset's model, not yet rendered
            drawn = earlier if earlier is not None and earlier.origin == origin else _Drawn(origin)
            has_grown |= drawn.catch_up()
            self._drawn[source.source] = drawn
        if any(self._drawn.get(name) is not drawn for name, drawn in before.items()):
            self._full = 0.0  # something else is drawn: its own scale
        return has_grown

    def _draw(self, take: Sounding) -> None:
        """Draw the frames that were read; the axis grows with the peak of what is drawn."""
        peak = max((drawn.peak for drawn in self._drawn.values()), default=0.0)
        if peak > self._full or self._full == 0.0:
            self._full = max(AIR * peak, FLAT)
        factor, unit = readable_unit(self._full, take.pickup)
        self.set_scale(factor * self._full, take.pickup, unit)
        for source, curve in self._curves.items():
            if source in self._drawn:
                drawn = self._drawn[source]
                signal = np.float32(factor) * drawn.origin.read(0, drawn.ready)
                self.show_signal(source, signal, drawn.origin.rate_hz)
            else:
                curve.setData([], [])

    def columns(self) -> Columns | None:
        """The frames in view."""
        if self._take is None:
            return None
        curves = {}
        for source, origin in ((source, drawn.origin) for source, drawn in self._drawn.items()):
            frames = self.plot.frames_in_view(origin.rate_hz, origin.ready)
            curves[source] = np.array(frames) / origin.rate_hz, origin.read(frames.start, frames.stop)
        return aligned("time (s)", self.by_heading(curves, unit_of(self._take.pickup)))

    def set_scale(self, full: float, quantity: str, unit: str) -> None:
        """Set the vertical axis, from −full to full in `unit`."""
        self.plot.getPlotItem().setYRange(-full, full, padding=0.02)
        self.plot.label.set(f"{quantity} ({unit})", unit)

    def show_signal(self, source: str, signal: NDArray[np.float32], rate_hz: int) -> None:
        """Show the samples so far, (frames,) from time 0, in the unit of the axis; draw all of those in view."""
        (low_s, high_s), columns = self.plot.times_s, self.plot.columns
        # A smoothed line that goes to and fro within a pixel takes ten times as long as a stroke for each, and a key
        # that is played waits for the painting.
        if (high_s - low_s) * rate_hz > columns:
            borders_s = np.linspace(low_s, high_s, columns + 1)
            edges = np.ceil(borders_s * rate_hz).astype(np.int64).clip(0, len(signal))
            joints = np.flatnonzero(edges[1:] > edges[:-1])
            middles_s = (borders_s[joints] + borders_s[joints + 1]) / 2
            # Where a period is a few pixels wide, each stroke has the extremes of a whole one, or they would beat.
            pixels = self._period_s * columns / (high_s - low_s)
            around = math.ceil(pixels) if 0 < pixels < FEW_PIXELS else 1
            values = extremes(signal, edges[joints[0] : joints[-1] + 2], around) if len(joints) else signal[:0]
            self._curves[source].setData(np.repeat(middles_s, 2), values, connect="pairs", antialias=False)
        else:
            first = min(max(int(low_s * rate_hz), 0), len(signal))
            last = min(max(int(high_s * rate_hz) + 2, first), len(signal))
            self._curves[source].setData(
                np.arange(first, last) / rate_hz, signal[first:last], connect="all", antialias=True
            )


def extremes(signal: NDArray[np.float32], edges: NDArray[np.int64], around: int = 1) -> NDArray[np.float32]:
    """A vertical stroke for each column of frames, from its lowest to its highest value: ends (2 · columns,).

    Each reaches as far as the next one's first sample, so that a steep flank has no gaps.

    Args:
        signal: (frames,).
        edges: (columns + 1,), rising: the frames at which each column begins, and where the last ends.
        around: a stroke has the extremes of so many columns, centred on its own.
    """
    starts, meets = edges[:-1], signal[np.minimum(edges[1:], len(signal) - 1)]
    values = np.empty(2 * len(starts), np.float32)
    lowest = np.minimum(np.minimum.reduceat(signal[: edges[-1]], starts), meets)
    highest = np.maximum(np.maximum.reduceat(signal[: edges[-1]], starts), meets)
    values[0::2] = _neighbours(lowest, around).min(axis=-1)
    values[1::2] = _neighbours(highest, around).max(axis=-1)
    return values


def _neighbours(values: NDArray[np.float32], around: int) -> NDArray[np.float32]:
    """The neighbours (values, around): each value with its neighbours."""
    before = (around - 1) // 2
    padded = np.pad(values, (before, around - 1 - before), mode="edge")
    return np.lib.stride_tricks.sliding_window_view(padded, around)
