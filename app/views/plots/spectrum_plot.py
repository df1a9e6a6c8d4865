"""Level over the logarithm of frequency: it zooms and pans, and the pointer or the arrow keys move its cursor."""

from __future__ import annotations

import math
from typing import ClassVar

from PySide6.QtCore import Qt

from app.views.plots.axis_label import frequency_ticks
from app.views.plots.zoom_plot import ZoomPlot

TIP = (
    "At the listening point and the playhead; 0 dB is a sine of the amplitude that the axis names.\n"
    "The wheel zooms, a drag pans, double-click shows all. Arrow keys move the cursor, + and − zoom"
)


class SpectrumPlot(ZoomPlot):
    """A plot with a cursor, the line of `KeptPlot`, at the log₁₀ of a frequency in Hz; NaN: there is none."""

    SHORTEST_VIEW = 0.005  # of log₁₀ of the frequency: a fifth of a semitone
    PAN_BUTTONS: ClassVar = ZoomPlot.PAN_BUTTONS | Qt.MouseButton.LeftButton

    def __init__(self) -> None:
        super().__init__("Spectrum", TIP, "frequency (Hz)")
        item = self.getPlotItem()
        item.setContentsMargins(0, 6, 0, 0)  # room for half of the topmost number
        item.setLogMode(x=True)
        item.setMouseEnabled(True, False)
        item.vb.sigXRangeChanged.connect(self._label_frequencies)
        self.move_line(math.nan)

    @property
    def view_hz(self) -> tuple[float, float]:
        """The lowest and the highest frequency of the view."""
        low, high = self.view_range
        return 10**low, 10**high

    def _label_frequencies(self) -> None:
        low, high = self.getPlotItem().vb.viewRange()[0]
        self.getPlotItem().getAxis("bottom").setTicks([frequency_ticks(10**low, 10**high)])

    def _seek(self, at: float) -> None:
        """Ask for a place of the cursor, and let the view go with it."""
        super()._seek(at)
        low, high = self.view_range
        self.pan(max(at - high, 0.0) + min(at - low, 0.0))
