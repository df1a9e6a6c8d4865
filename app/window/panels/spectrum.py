"""The spectrum of what the slots hold, as it is heard at the playhead: level over the logarithm of frequency."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import Qt

from app.analysis.heard import HeardSignal
from app.analysis.spectrogram import FrequencyRows
from app.export.columns import Columns, aligned
from app.presets.library import Library
from app.rendering import BlowTake, Take
from app.session.shown import ShownSource, level_words, shown_sources
from app.shared.key_names import note_name
from app.stage.session import Session
from app.views import theme
from app.views.controls.elided_label import Readout
from app.views.controls.parts import combo_box, faint, lay_out_view
from app.views.plots.axis_label import LOWEST_HZ, RANGES_DB
from app.views.plots.spectrum_plot import SpectrumPlot
from app.window.panels.base import LEAST_HEIGHT, Moment
from app.window.panels.curves import CurvesPanel

FLOOR_DB, CEILING_DB = -130.0, 0.0  # levels below the floor are drawn there; the top of the axis
WINDOW_S = 0.18  # about the length of the analysed window
COLUMNS = 480  # points of a curve
PADDING = 4  # length of the transform, in windows
AREA_STEP = 3  # columns to a point of the filled area


@dataclass(frozen=True)
class Analyser:
    """A Hann-windowed magnitude spectrum on `COLUMNS` logarithmic columns, 0 dB for a full-scale sine.

    The columns lie between two frequencies, as far as half the rate.
    """

    rate_hz: int
    lowest_hz: float = LOWEST_HZ
    highest_hz: float = math.inf

    @property
    def window_frames(self) -> int:
        """The length of the window: about `WINDOW_S`, rounded to a power of two of frames."""
        return 2 ** round(math.log2(WINDOW_S * self.rate_hz))

    @cached_property
    def column_hz(self) -> NDArray[np.float64]:
        """The middles of the columns in Hz, (COLUMNS,), rising."""
        edges = np.geomspace(self.lowest_hz, min(self.highest_hz, self.rate_hz / 2), COLUMNS + 1)
        return np.sqrt(edges[1:] * edges[:-1])

    @cached_property
    def _window(self) -> NDArray[np.float32]:
        """The Hann window, (window_frames,), scaled so that a full-scale sine has the magnitude 1."""
        window = np.hanning(self.window_frames)
        return (window * 2 / window.sum()).astype(np.float32)

    @cached_property
    def _rows(self) -> FrequencyRows:
        bins, bin_hz = PADDING * self.window_frames // 2 + 1, self.rate_hz / (PADDING * self.window_frames)
        return FrequencyRows(bins, bin_hz, COLUMNS, self.lowest_hz, True, self.highest_hz)

    def level_db(self, signal: NDArray[np.float32]) -> NDArray[np.float32]:
        """Levels in dB, (COLUMNS,), of the first `window_frames` of a signal; a shorter one is padded with zeros.

        Args:
            signal: (frames,), in units of full scale.
        """
        frames = self.window_frames
        block = np.zeros(frames, np.float32)
        block[: min(frames, len(signal))] = signal[:frames]
        magnitude = np.abs(np.fft.rfft((block - block.mean()) * self._window, PADDING * frames))
        levels_db = 20 * np.log10(magnitude + 1e-12).astype(np.float32)
        return np.maximum(self._rows.of(levels_db[np.newaxis])[0], np.float32(FLOOR_DB))


@lru_cache(maxsize=4)
def analyser_at(rate_hz: int, lowest_hz: float = LOWEST_HZ, highest_hz: float = math.inf) -> Analyser:
    """The analyser of a rate and a range; it is kept, with its window and columns."""
    return Analyser(rate_hz, lowest_hz, highest_hz)


class SpectrumPanel(CurvesPanel):
    """The spectra; pointer or arrow keys read a frequency, its note, and the level of each curve."""

    faint_alpha = 150
    key = "spectrum"
    title = "Spectrum"
    help = (
        "Level against frequency of what slots A and B hold, at the playhead and the listening point, on the same "
        "axes; 0 dB is a sine of the amplitude that the axis names. Here a partial that is out of tune or decays "
        "wrongly is seen first."
    )

    def __init__(self, session: Session, library: Library) -> None:
        # slot B's, of a third of the points and not smoothed: to fill the curve itself takes longer than all else
        self._area = pg.PlotCurveItem(pen=None, fillLevel=FLOOR_DB, antialias=False)
        self._area_of: str | None = None  # slot B's source; None: nothing is filled
        # by source, each of a rate of its own; levels in dB, (COLUMNS,)
        self._levels: dict[str, tuple[Analyser, NDArray[np.float32]]] = {}
        super().__init__(session, library, SpectrumPlot())
        self.setMinimumHeight(LEAST_HEIGHT)
        tip = "How far below full scale the axis reaches, the same for every source"
        ranges = [(f"{db} dB", db) for db in RANGES_DB]
        self.ranges = combo_box("Dynamic range", ranges, RANGES_DB[-1], tip, lambda _: self._fit())
        self.readout = Readout()
        item = self.plot.getPlotItem()
        self.plot.label.set("dB re 10 mm", "dB")
        item.addItem(self._area)
        self._partial = pg.InfiniteLine(0, pen=pg.mkPen(theme.FAINT, width=1, style=Qt.PenStyle.DotLine))
        self._partial.hide()
        item.addItem(self._partial, ignoreBounds=True)
        self._partials_hz = np.zeros(0)  # (modes,), of the take at rest, rising
        self._rate_hz = 16_000  # the highest of what is drawn
        self._fit()
        self.plot.hovered.connect(lambda height, _: self.point_at(10**height))
        self.plot.seek_asked.connect(lambda height: self.point_at(10**height))
        lay_out_view(self, (faint("range"), self.ranges), self.readout, (), self.plot, gap=0)

    def choices_changed(self, names: frozenset[str]) -> None:
        super().choices_changed(names)
        if "ear" in names:
            self.plot.label.set(level_words(self.session.choices.pickup.kind), "dB")

    def take_started(self, take: Take | BlowTake) -> None:
        super().take_started(take)
        self._partials_hz = take.partials_hz
        self.plot.label.set(level_words(take.pickup), "dB")

    def _draw_moment(self, moment: Moment) -> None:
        """Draw the spectra at the playhead of all sources in the slots; clear those not rendered or out of view."""
        take, choices = moment.sounding, self.session.choices
        if take is None or not self._is_new(*moment.standing(choices), self.plot.view_range):
            return
        signals = [HeardSignal(take.listened.signals, s.source, s.gain) for s in shown_sources(choices, self.library)]
        rendered = [signal for signal in signals if signal.there]
        self.set_rate(max((signal.rate_hz for signal in rendered), default=take.rate_hz))
        lowest_hz = self.plot.view_hz[0]
        for signal in signals:
            if signal in rendered and lowest_hz < signal.rate_hz / 2:
                self._draw(signal, moment.position_s, take.full_scale)
            else:
                self._clear(signal.source)
        self._show_readout()

    def _draw(self, signal: HeardSignal, position_s: float, full_scale: float) -> None:
        """Draw the spectrum of the window that begins at the playhead, or earlier where the signal ends.

        Args:
            full_scale: the signal's value at 0 dB, in its unit.
        """
        analyser = analyser_at(signal.rate_hz, *self.plot.view_hz)
        last_window = signal.ready - analyser.window_frames  # the window does not pass the end of the signal
        first = max(0, min(round(position_s * analyser.rate_hz), last_window))
        samples = signal.read(first, first + analyser.window_frames) / full_scale
        self.show_signal(signal.source, samples, analyser)

    def set_rate(self, rate_hz: int) -> None:
        """Fit the frequency axis to a rate."""
        if rate_hz != self._rate_hz:
            self._rate_hz = rate_hz
            self._fit()

    def set_sources(self, sources: tuple[ShownSource, ...], part: str = "") -> None:
        """Set the sources that are drawn; slot B's curve is filled."""
        super().set_sources(sources, part)
        self._area_of = next((s.source for s in sources if "B" in s.slots and len(sources) > 1), None)
        if self._area_of:
            hue = theme.SOURCE_COLOURS[theme.source_kind(self._area_of)]
            self._area.setBrush(pg.mkBrush(theme.translucent(hue, 28)))
        self._levels = {name: levels for name, levels in self._levels.items() if name in self._curves}

    def show_signal(self, source: str, signal: NDArray[np.float32], analyser: Analyser) -> None:
        """Draw the spectrum of a window of signal, (frames,), in units of full scale."""
        levels = analyser.level_db(signal)
        self._levels[source] = analyser, levels
        self._curves[source].setData(analyser.column_hz, levels)
        if source == self._area_of:
            tops_db = levels.reshape(-1, AREA_STEP).max(axis=1)
            middles = np.log10(analyser.column_hz[AREA_STEP // 2 :: AREA_STEP])
            self._area.setData(middles, tops_db, skipFiniteCheck=True)

    def _clear(self, source: str) -> None:
        self._levels.pop(source, None)
        self._curves[source].setData([], [])
        if source == self._area_of:
            self._area.setData([], [])

    def columns(self) -> Columns:
        """The points of the curves in view."""
        curves = {source: (analyser.column_hz, levels_db) for source, (analyser, levels_db) in self._levels.items()}
        return aligned("frequency (Hz)", self.by_heading(curves, level_words(self.session.choices.pickup.kind)))

    def levels_db(self, frequency_hz: float) -> dict[str, float]:
        """The levels drawn at a frequency, by source, without sources of which it is not drawn."""
        levels_db = {}
        for source, (analyser, levels) in self._levels.items():
            if analyser.lowest_hz <= frequency_hz <= min(analyser.highest_hz, analyser.rate_hz / 2):
                column = int(np.abs(np.log(analyser.column_hz / frequency_hz)).argmin())
                levels_db[source] = float(levels[column])
        return levels_db

    def point_at(self, frequency_hz: float) -> None:
        """Move the cursor to a frequency; NaN: there is none."""
        self.plot.move_line(math.log10(frequency_hz))
        self.plot.setAccessibleDescription(self._show_readout())  # not again and again while levels fall

    def _show_readout(self) -> str:
        """Write the frequency at the cursor, its note, levels and nearest partial of a quiet pluck; return all."""
        frequency_hz, wordings = 10**self.plot.line_at, [""]
        shows_partial = math.isfinite(frequency_hz) and len(self._partials_hz) > 0
        if math.isfinite(frequency_hz):
            levels_db = self.levels_db(frequency_hz)
            seen = [s for s in shown_sources(self.session.choices, self.library) if s.source in levels_db]
            levels = "   ".join(f"{source.slots} {levels_db[source.source]:.1f} dB" for source in seen)
            pitch = f"{frequency_hz:.1f} Hz   {note_words(frequency_hz)}"
            wordings = [f"{pitch}   {levels}", levels or pitch]
        if shows_partial:
            nearest = int(np.abs(np.log(self._partials_hz / frequency_hz)).argmin())
            partial_hz = float(self._partials_hz[nearest])
            cents = round(1200 * math.log2(frequency_hz / partial_hz))
            wordings.insert(0, f"{wordings[0]}   partial {nearest + 1}: {partial_hz:.1f} Hz ({cents:+d} cents)")
            self._partial.setValue(math.log10(partial_hz))
        self._partial.setVisible(shows_partial)
        self.readout.report(*wordings)
        return wordings[0]

    def _fit(self) -> None:
        """Set the axes: frequency as far as half the rate, levels as far down as the chosen range."""
        self.plot.set_ends(math.log10(LOWEST_HZ), math.log10(self._rate_hz / 2))
        self.plot.getPlotItem().setYRange(CEILING_DB - self.range_db, CEILING_DB, padding=0)

    @property
    def range_db(self) -> int:
        return int(self.ranges.currentData())


def note_words(frequency_hz: float) -> str:
    """The nearest note of equal temperament (A4 at 440 Hz), and the interval from it in cents."""
    key = 69 + 12 * math.log2(frequency_hz / 440)
    return f"{note_name(round(key))} {round(100 * (key - round(key))):+d} cents"
