"""Level over time and frequency, one source at a time, on the same scale for all."""

from __future__ import annotations

import math

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QRectF, Signal
from PySide6.QtWidgets import QWidget

from app.views import theme
from app.views.controls.parts import combo_box, lay_out_plot
from app.views.controls.readout import Readout
from app.views.controls.segments import SMALL, Segments
from app.views.plots.axis_label import UprightLabel, UprightTicks
from app.views.plots.colour_maps import level_map
from app.views.plots.frequency_axis import LOWEST_HZ, RANGES_DB, frequency_ticks
from app.views.plots.time_plot import TimePlot

QUANTITIES = (
    ("model", "Model", "Sound of the model"),
    ("truth", "Truth", "Sound of the truth"),
    ("error", "Error", "Model − truth, on the same scale"),
)
SCALES = (("log", "Log", "Octaves of equal height"), ("linear", "Linear", "Partials at equal distances"))


class SpectrogramView(QWidget):
    """0 dB is a sine of full scale; levels below the chosen range have the colour of the background."""

    frequencies_changed = Signal()  # logarithmic or linear: the rows of the picture are of other frequencies

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.quantities = Segments("Shown", QUANTITIES)
        self.scales = Segments("Frequency axis", SCALES)
        self.ranges = combo_box("Dynamic range", ((f"{db} dB", db) for db in RANGES_DB), 90)
        self.ranges.setToolTip("Range of levels below full scale, the same for every source")
        self.ranges.setStyleSheet(SMALL)
        self.readout = Readout()
        self.plot = TimePlot(
            "Spectrogram",
            "The sound at the listening point over time. Click moves the playhead; the wheel zooms in time,\n"
            "the right button pans; double-click shows all. Arrow keys move the playhead, + and − zoom",
            shaded=False,
        )
        self._highest_hz = 8000.0
        self._levels_db: NDArray[np.float32] | None = None
        self._pixels = np.zeros((0, 0), np.uint8)
        self._hop_s = 1.0
        item = self.plot.getPlotItem()
        axis = item.getAxis("left")
        axis.enableAutoSIPrefix(False)
        self._label = UprightLabel(item, ("frequency (Hz)", "Hz"))
        self._ticks = UprightTicks(axis, item.vb)
        self._image = pg.ImageItem(axisOrder="col-major", autoDownsample=False)
        self._image.setLookupTable(level_map().getLookupTable(nPts=256))
        item.addItem(self._image, ignoreBounds=True)
        self._bar = pg.ColorBarItem(values=(-self.range_db, 0), width=10, colorMap=level_map(), interactive=False)
        self._bar.setImageItem([], insert_in=item)
        self._bar_label = UprightLabel(self._bar, ("dB",))
        theme.changes.theme_changed.connect(self._take_theme)
        self.scales.chosen.connect(self._choose_scale)
        self.ranges.activated.connect(self._choose_range)
        self._label_frequencies()
        lay_out_plot(self, (self.quantities, self.scales, self.ranges), self.readout, self.plot)

    @property
    def quantity(self) -> str:
        """ "model", "truth" or "error"."""
        return self.quantities.key

    @property
    def logarithmic(self) -> bool:
        return self.scales.key == "log"

    @property
    def range_db(self) -> int:
        return int(self.ranges.currentData())

    @property
    def lowest_hz(self) -> float:
        """At the lower end of the axis."""
        return LOWEST_HZ if self.logarithmic else 0.0

    def frequency_hz(self, height: float) -> float:
        """The frequency at a place on the vertical axis."""
        return 10**height if self.logarithmic else height

    def set_take(self, seconds: float, horizon_s: float, rate_hz: int) -> None:
        """A new take; the frequency axis ends at half its rate."""
        self.plot.set_times(seconds, horizon_s)
        if rate_hz / 2 != self._highest_hz:
            self._highest_hz = rate_hz / 2
            self._label_frequencies()

    def set_full_scale(self, words: str) -> None:
        """The amplitude of the sine that is 0 dB, in words."""
        self._bar_label.set(f"dB re {words}", "dB")

    def begin_picture(self, columns: int, rows: int, hop_s: float) -> None:
        """Clears the picture; the columns to come are `rows` high, the k-th at the time k·hop_s."""
        self._levels_db = np.zeros((columns, rows), np.float32)
        self._pixels = np.zeros((columns, rows), np.uint8)
        self._hop_s = hop_s
        self._drawn = 0
        self._image.clear()

    def show_columns(self, first: int, levels_db: NDArray[np.float32]) -> None:
        """Draws levels (columns, rows) from the column `first` on."""
        assert self._levels_db is not None
        self._drawn = first + len(levels_db)
        self._levels_db[first : self._drawn] = levels_db
        self._colour(first)

    def _colour(self, first: int) -> None:
        """Colours the levels from a column on."""
        assert self._levels_db is not None
        share = self._levels_db[first : self._drawn] / self.range_db + 1
        self._pixels[first : self._drawn] = np.clip(share, 0, 1) * 255
        if self._drawn:
            self._tell_range()
            self._image.setImage(self._pixels[: self._drawn], autoLevels=False, levels=(0, 255))
            low, high = self._heights()
            half = self._hop_s / 2
            self._image.setRect(QRectF(-half, low, self._drawn * self._hop_s, high - low))

    def _tell_range(self) -> None:
        """Says so where all levels are below the range, and nothing is seen."""
        assert self._levels_db is not None
        below = float(self._levels_db[: self._drawn].max()) < -self.range_db
        words = f"below −{self.range_db} dB"
        self.readout.rest(*((f"all levels are {words}", words) if below else ("",)))

    def _take_theme(self) -> None:
        self._image.setLookupTable(level_map().getLookupTable(nPts=256))
        self._bar.setColorMap(level_map())

    def _choose_scale(self) -> None:
        self._label_frequencies()
        self.frequencies_changed.emit()

    def _choose_range(self) -> None:
        self._bar.setLevels((-self.range_db, 0))
        if self._levels_db is not None:
            self._colour(0)

    def _heights(self) -> tuple[float, float]:
        if self.logarithmic:
            return math.log10(LOWEST_HZ), math.log10(self._highest_hz)
        return 0.0, self._highest_hz

    def _label_frequencies(self) -> None:
        item = self.plot.getPlotItem()
        item.setYRange(*self._heights(), padding=0)
        self._ticks.set(frequency_ticks() if self.logarithmic else None)
