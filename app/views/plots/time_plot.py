"""The parts of all plots over the time of a take: the end of training, the playhead, gestures and keys.

A click or a drag moves the playhead, the wheel zooms in time, the middle or right button pans. The keyboard does the
same: arrows, + and -, Home.
"""

from __future__ import annotations

import pyqtgraph as pg
from PySide6.QtCore import QPointF, Qt, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent, QWheelEvent

from app.views import theme
from app.views.plots.kept_plot import KeptPlot

SEEK_STEP_S = 0.1
SEEK_STEP_SHARE = 0.05  # of what is in view, where that is less
ZOOM_STEP = 1.25
SHORTEST_VIEW_S = 0.002
_PAN_BUTTONS = Qt.MouseButton.MiddleButton | Qt.MouseButton.RightButton


class TimePlot(KeptPlot):
    """The owner draws the curves; the line of `KeptPlot` is the playhead, in s."""

    seek_asked = Signal(float)  # a time in s
    pointed = Signal(float, float)  # a press with Shift: time in s, place on the vertical axis

    def __init__(self, name: str, tip: str, *, shaded: bool = True) -> None:
        """Make a plot; `shaded`: the time past training is shaded; not under an image, which would hide the shade."""
        super().__init__(name, tip, "time (s)")
        self.setMinimumHeight(84)
        item = self.getPlotItem()
        item.setContentsMargins(0, 6, 4, 0)  # room for half of the topmost number
        item.setMouseEnabled(True, False)
        self._shaded = shaded
        self._seconds = 1.0
        self._pan_from: float | None = None  # in pixels
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
        item.setXRange(0, self._seconds, padding=0)

    def set_times(self, seconds: float, horizon_s: float) -> None:
        """Set the length of the take and of its model's training; the view is kept after a take as long."""
        item = self.getPlotItem()
        item.setLimits(xMin=0, xMax=seconds, minXRange=min(SHORTEST_VIEW_S, seconds))
        if seconds != self._seconds:
            self._seconds = seconds
            self.show_all()
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
        low, high = self.getPlotItem().vb.viewRange()[0]
        return max(low, 0.0), min(high, self._seconds)

    @property
    def columns(self) -> int:
        """The width of the view in pixels of the screen; 1 at least."""
        return max(round(self.getPlotItem().vb.width() * self.devicePixelRatioF()), 1)

    # Zoom and pan

    def show_all(self) -> None:
        self.show_times(0.0, self._seconds)

    def show_times(self, low_s: float, high_s: float) -> None:
        """Set the view, moved into the take where it lies beyond its ends."""
        span = min(max(high_s - low_s, SHORTEST_VIEW_S), self._seconds)
        low_s = min(max(low_s, 0.0), self._seconds - span)
        self.getPlotItem().setXRange(low_s, low_s + span, padding=0)

    def zoom(self, factor: float, about_s: float | None = None) -> None:
        """Show `factor` times as much; about the playhead by default, or the middle if that is not in view."""
        low, high = self.times_s
        if about_s is None:
            about_s = self.line_at if low <= self.line_at <= high else (low + high) / 2
        self.show_times(about_s - (about_s - low) * factor, about_s + (high - about_s) * factor)

    def pan(self, by_s: float) -> None:
        """Move the view to later times; to earlier ones where `by_s` is negative."""
        low, high = self.times_s
        self.show_times(low + by_s, high + by_s)

    # Gestures

    def wheelEvent(self, event: QWheelEvent) -> None:
        turn, low_high = event.angleDelta(), self.times_s
        if turn.y():
            self.zoom(ZOOM_STEP ** (-turn.y() / 120), self.place_at(event.position()).x())
        if turn.x():
            self.pan(-turn.x() / 120 * 0.1 * (low_high[1] - low_high[0]))
        event.accept()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self.setFocus(Qt.FocusReason.MouseFocusReason)
        if event.button() == Qt.MouseButton.LeftButton:
            self._follow(event)
        elif event.button() & _PAN_BUTTONS:
            self._pan_from = event.position().x()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if event.buttons() & Qt.MouseButton.LeftButton:
            self._follow(event)
        elif event.buttons() & _PAN_BUTTONS and self._pan_from is not None:
            at = event.position()
            shift_s = self.place_at(QPointF(self._pan_from, at.y())).x() - self.place_at(at).x()
            self._pan_from = at.x()
            self.pan(shift_s)
        self._hover(event.position())

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self._pan_from = None

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        self.show_all()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        low, high = self.times_s
        step_s = min(SEEK_STEP_S, SEEK_STEP_SHARE * (high - low))
        match event.key():
            case Qt.Key.Key_Left:
                self._seek(self.line_at - step_s)
            case Qt.Key.Key_Right:
                self._seek(self.line_at + step_s)
            case Qt.Key.Key_Home:
                self._seek(0.0)
            case Qt.Key.Key_Plus | Qt.Key.Key_Equal:
                self.zoom(1 / ZOOM_STEP**2)
            case Qt.Key.Key_Minus:
                self.zoom(ZOOM_STEP**2)
            case Qt.Key.Key_0:
                self.show_all()
            case _:
                super().keyPressEvent(event)

    def _follow(self, event: QMouseEvent) -> None:
        point = self.place_at(event.position())
        if event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
            self.pointed.emit(point.x(), point.y())
        self._seek(point.x())

    def _seek(self, time_s: float) -> None:
        self.seek_asked.emit(min(max(time_s, 0.0), self._seconds))
