"""The parts of all plots over the time of a take: the end of training, the playhead, gestures and keys.

A click or a drag moves the playhead, and so do arrows and Home. The middle or right button pans.
"""

from __future__ import annotations

import math

import pyqtgraph as pg
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QMouseEvent

from app.views import theme
from app.views.plots.zoom_plot import ZoomPlot


class TimePlot(ZoomPlot):
    """The owner draws the curves; the line of `KeptPlot` is the playhead, in s."""

    SHORTEST_VIEW = 0.002  # s
    LONGEST_STEP = 0.1  # s
    pointed = Signal(float, float)  # a press with Shift: time in s, place on the vertical axis

    def __init__(self, name: str, tip: str, *, shaded: bool = True) -> None:
        """Make a plot; `shaded`: the time past training is shaded; not under an image, which would hide the shade."""
        super().__init__(name, tip, "time (s)")
        self.setMinimumHeight(84)
        item = self.getPlotItem()
        item.setContentsMargins(0, 6, 4, 0)  # room for half of the topmost number
        item.setMouseEnabled(True, False)
        self._shaded = shaded
        self._untrained = pg.LinearRegionItem(
            (1, 1), movable=False, brush=pg.mkBrush(theme.translucent(theme.WARNING, 18)), pen=pg.mkPen(None)
        )
        self.horizon = pg.InfiniteLine(
            1,
            pen=pg.mkPen(theme.WARNING, width=1, style=Qt.PenStyle.DashLine),
            label="end of training",
            labelOpts={
                "color": theme.WARNING,
                "position": 0.86,
                "anchors": [(0, 0.5), (0, 0.5)],
                "fill": theme.translucent(theme.PANEL, 170 if shaded else 235),
            },
        )
        self._edge = pg.InfiniteLine(1, pen=pg.mkPen(theme.translucent(theme.PANEL, 235), width=3))
        for thing, depth in ((self._untrained, -10), (self._edge, 19), (self.horizon, 20)):
            thing.setZValue(depth)
            item.addItem(thing, ignoreBounds=True)
        self.show_all()

    def set_times(self, seconds: float, horizon_s: float) -> None:
        """Set the length of the take and of its model's training; the view is kept after a take as long."""
        self.set_ends(0.0, seconds)
        inside = horizon_s < seconds
        self._untrained.setRegion((horizon_s, max(seconds, horizon_s)))
        self.horizon.setValue(horizon_s)
        self._edge.setValue(horizon_s)
        self._edge.setVisible(inside and not self._shaded)  # sets the line off from an image
        self.horizon.setVisible(inside)
        self._untrained.setVisible(inside and self._shaded)

    def show_playhead(self, position_s: float) -> None:
        """Move the playhead, at no cost where it is there already."""
        if position_s != self.line_at:
            self.move_line(position_s)

    @property
    def times_s(self) -> tuple[float, float]:
        """The start and the end of the view, within the take."""
        return self.view_range

    def frames_in_view(self, rate_hz: float, ready: int) -> range:
        """The numbers of the frames (samples) in view, of the first `ready`, which are rendered, at a rate."""
        low_s, high_s = self.times_s
        first = math.ceil(low_s * rate_hz)
        return range(first, max(first, min(math.floor(high_s * rate_hz) + 1, ready)))

    @property
    def columns(self) -> int:
        """The width of the view in pixels of the screen; 1 at least."""
        return max(round(self.getPlotItem().vb.width() * self.devicePixelRatioF()), 1)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        super().mousePressEvent(event)
        if event.button() == Qt.MouseButton.LeftButton:
            self._follow(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if event.buttons() & Qt.MouseButton.LeftButton:
            self._follow(event)
        super().mouseMoveEvent(event)

    def _follow(self, event: QMouseEvent) -> None:
        point = self.place_at(event.position())
        if event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
            self.pointed.emit(point.x(), point.y())
        self._seek(point.x())
