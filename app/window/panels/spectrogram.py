"""The spectrogram at the listening point: level over time and frequency, one source at a time, on one scale."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QRectF

from app.analysis.spectrogram import FrequencyRows, Spectrogram
from app.export.columns import Columns
from app.presets.library import Library
from app.rendering import BlowTake, Sounding, Take
from app.session.shown import level_words
from app.stage.session import Session
from app.views import theme
from app.views.controls.parts import combo_box
from app.views.controls.segments import Segments
from app.views.plots.axis_label import LOWEST_HZ, RANGES_DB, UprightLabel, frequency_ticks
from app.views.plots.colour_maps import level_map
from app.views.plots.time_plot import TimePlot
from app.window.panels.time_panel import TimePanel

ROWS = 320  # of the picture, over frequency
MOST_COLUMNS = 600  # drawn in one call, so that a panel that is opened late catches up in short steps
QUANTITIES = (
    ("model", "Model", "Sound of the model"),
    ("truth", "Truth", "Sound of the truth"),
    ("error", "Error", "Model − truth, on the same scale"),
)
SCALES = (("log", "Log", "Octaves of equal height"), ("linear", "Linear", "Partials at equal distances"))


class SpectrogramPanel(TimePanel[Spectrogram]):
    """The spectrogram, 0 dB being a sine of full scale; levels below the range have the colour of the background."""

    of_strings = False
    key = "spectrogram"
    title = "Spectrogram"
    help = (
        "Level over time and frequency of the pick-up's signal at the listening point: model, truth or their "
        "difference, all on one scale."
    )

    def __init__(self, session: Session, library: Library) -> None:
        tip = (
            "The sound at the listening point over time. Click moves the playhead; the wheel zooms in time,\n"
            "the right button pans; double-click shows all. Arrow keys move the playhead, + and − zoom"
        )
        super().__init__(session, library, TimePlot("Spectrogram", tip, shaded=False))
        self.quantities = Segments("Shown", QUANTITIES)
        self.scales = Segments("Frequency axis", SCALES)
        ranges, tip = (
            [(f"{db} dB", db) for db in RANGES_DB],
            "Range of levels below full scale, the same for every source",
        )
        self.ranges = combo_box("Dynamic range", ranges, 90, tip, lambda _: self._choose_range())
        self._rows: FrequencyRows | None = None  # bins to rows; None: nothing is drawn yet
        self._levels_db = np.zeros((0, ROWS), np.float32)  # (columns, rows); filled as far as drawn
        self._pixels = np.zeros((0, ROWS), np.uint8)  # (columns, rows): 0 is the range's end, 255 is 0 dB
        self._drawn = 0  # columns so far
        self._hop_s = 1.0  # time from a column to the next
        self._highest_hz = 8000.0  # top of the axis: half the take's rate
        item = self.plot.getPlotItem()
        self.plot.label.set("frequency (Hz)", "Hz")
        self._image = pg.ImageItem(axisOrder="col-major", autoDownsample=False)
        item.addItem(self._image, ignoreBounds=True)
        self._bar = pg.ColorBarItem(values=(-self.range_db, 0), width=10, colorMap=level_map(), interactive=False)
        self._bar.setImageItem([], insert_in=item)
        self._bar_label = UprightLabel(self._bar, ("dB",))
        self._take_theme()
        theme.changes.theme_changed.connect(self._take_theme)
        self.scales.chosen.connect(self._label_frequencies)
        self._label_frequencies()
        self._lay_out(self.quantities, self.scales, self.ranges)

    @property
    def logarithmic(self) -> bool:
        return self.scales.key == "log"

    @property
    def range_db(self) -> int:
        return int(self.ranges.currentData())

    def frequency_hz(self, height: float) -> float:
        """The frequency at a place on the vertical axis: log₁₀ of Hz where it is logarithmic, else Hz."""
        return 10**height if self.logarithmic else height

    def choices_changed(self, names: frozenset[str]) -> None:
        if "ear" in names:
            self._bar_label.set(level_words(self.session.choices.pickup.kind), "dB")

    def take_started(self, take: Take | BlowTake) -> None:
        super().take_started(take)
        self._bar_label.set(level_words(take.pickup), "dB")
        if take.rate_hz / 2 != self._highest_hz:
            self._highest_hz = take.rate_hz / 2
            self._label_frequencies()

    def _begin(self, take: Sounding) -> Spectrogram:
        figures = Spectrogram(take, take.listened)
        self._keep_up(figures)
        return figures

    def _is_of(self, figures: Spectrogram, take: Sounding) -> bool:
        return figures.listened is take.listened

    def _draw(self, figures: Spectrogram) -> None:
        """Draw the next MOST_COLUMNS at most; begin the picture again for another take, source or axis."""
        if figures.ready == 0:
            return  # the picture before stays until there is something new
        if self._is_new(figures, self.quantities.key, self.logarithmic):
            bins = figures.window_frames // 2 + 1
            lowest_hz = LOWEST_HZ if self.logarithmic else 0.0
            self._rows = FrequencyRows(bins, figures.bin_hz, ROWS, lowest_hz, self.logarithmic)
            self.begin_picture(figures.columns, ROWS, figures.hop_s)
        last = min(figures.ready, self._drawn + MOST_COLUMNS)
        if last > self._drawn:
            assert self._rows is not None
            self.show_columns(self._rows.of(figures.levels_db[self.quantities.key][self._drawn : last]))

    def begin_picture(self, columns: int, rows: int, hop_s: float) -> None:
        """Clear the picture; the columns to come are `rows` high, the k-th at the time k·hop_s."""
        self._levels_db = np.zeros((columns, rows), np.float32)
        self._pixels = np.zeros((columns, rows), np.uint8)
        self._hop_s = hop_s
        self._drawn = 0
        self._image.clear()

    def show_columns(self, levels_db: NDArray[np.float32]) -> None:
        """Draw the next levels in dB, (columns, rows), to the right of those drawn."""
        first, self._drawn = self._drawn, self._drawn + len(levels_db)
        self._levels_db[first : self._drawn] = levels_db
        self._colour(first)

    def _colour(self, first: int) -> None:
        """Colour the levels from column `first` to the last drawn.

        Where all drawn so far are below the range, so that nothing is seen, the readout reports it.
        """
        share = self._levels_db[first : self._drawn] / self.range_db + 1
        self._pixels[first : self._drawn] = np.clip(share, 0, 1) * 255
        if self._drawn:
            words = f"below −{self.range_db} dB"
            below = float(self._levels_db[: self._drawn].max()) < -self.range_db
            self.readout.rest(*((f"all levels are {words}", words) if below else ("",)))
            self._image.setImage(self._pixels[: self._drawn], autoLevels=False, levels=(0, 255))
            low, high = self._heights()
            half = self._hop_s / 2
            self._image.setRect(QRectF(-half, low, self._drawn * self._hop_s, high - low))

    def columns(self) -> Columns | None:
        """All levels of the columns in view."""
        figures = self._made
        if figures is None:
            return None
        frames = self.plot.frames_in_view(1 / figures.hop_s, figures.ready)
        unit, levels_db = level_words(figures.take.pickup), figures.levels_db[self.quantities.key]
        levels = enumerate(levels_db[frames.start : frames.stop].T)
        bins = {f"{number * figures.bin_hz:.10g} Hz ({unit})": level for number, level in levels}
        return Columns({"time (s)": np.array(frames) * figures.hop_s, **bins})

    def _words(self, figures: Spectrogram, time_s: float, place: float) -> Iterable[str]:
        frequency_hz = self.frequency_hz(place)
        column, row = round(time_s / figures.hop_s), round(frequency_hz / figures.bin_hz)
        levels_db = figures.levels_db[self.quantities.key][: figures.ready]
        if not (0 <= column < len(levels_db) and 0 <= row < levels_db.shape[1]):
            return []
        level, frequency = f"{levels_db[column, row]:.1f} dB", f"{frequency_hz:.0f} Hz"
        return [f"{time_s:.3f} s   {frequency}   {level}", f"{frequency}   {level}", level]

    def _take_theme(self) -> None:
        self._image.setLookupTable(level_map().getLookupTable(nPts=256))
        self._bar.setColorMap(level_map())

    def _choose_range(self) -> None:
        self._bar.setLevels((-self.range_db, 0))
        self._colour(0)

    def _heights(self) -> tuple[float, float]:
        """The ends of the vertical axis, lowest first: log₁₀ of Hz where it is logarithmic, else Hz."""
        if self.logarithmic:
            return math.log10(LOWEST_HZ), math.log10(self._highest_hz)
        return 0.0, self._highest_hz

    def _label_frequencies(self) -> None:
        self.plot.getPlotItem().setYRange(*self._heights(), padding=0)
        self.plot.ticks.set(frequency_ticks() if self.logarithmic else None)
