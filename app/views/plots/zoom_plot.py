"""A plot whose horizontal axis zooms and pans within its ends.

The wheel zooms, a drag pans, a double-click shows all. The keyboard does the same: + and −, 0. Arrow keys ask for
another place of the line.
"""

from __future__ import annotations

import math
from typing import ClassVar

from PySide6.QtCore import QPointF, Qt, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent, QWheelEvent

from app.views.plots.kept_plot import KeptPlot

ZOOM_STEP = 1.25
LINE_STEP = 0.05  # of the line by an arrow key, as a share of the view


class ZoomPlot(KeptPlot):
    """A plot whose view, the part of the axis that is shown, is zoomed and moved."""

    SHORTEST_VIEW: ClassVar[float]  # in the unit of the axis, as the next
    LONGEST_STEP: ClassVar[float] = math.inf  # of the line, by a key
    PAN_BUTTONS: ClassVar = Qt.MouseButton.MiddleButton | Qt.MouseButton.RightButton

    seek_asked = Signal(float)  # a place for the line

    def __init__(self, name: str, tip: str, foot: str = "") -> None:
        super().__init__(name, tip, foot)
        self._ends = 0.0, 1.0  # of the axis, between which the view is moved
        self._pan_from: float | None = None  # x of the mouse at its last move, in pixels; None: it does not pan

    def set_ends(self, low: float, high: float) -> None:
        """Set the ends of the axis; the view is kept where they are the same."""
        least = min(self.SHORTEST_VIEW, high - low)
        self.getPlotItem().setLimits(xMin=low, xMax=high, minXRange=least)
        if (low, high) != self._ends:
            self._ends = low, high
            self.show_all()

    @property
    def view_range(self) -> tuple[float, float]:
        """The start and the end of the view, within the ends of the axis."""
        low, high = self.getPlotItem().vb.viewRange()[0]
        return max(low, self._ends[0]), min(high, self._ends[1])

    def show_all(self) -> None:
        self.show_range(*self._ends)

    def show_range(self, low: float, high: float) -> None:
        """Set the view, moved between the ends of the axis where it lies beyond them."""
        lowest, highest = self._ends
        span = min(max(high - low, self.SHORTEST_VIEW), highest - lowest)
        low = min(max(low, lowest), highest - span)
        self.getPlotItem().setXRange(low, low + span, padding=0)

    def zoom(self, factor: float, about: float | None = None) -> None:
        """Show `factor` times as much; about the line by default, or the middle if that is not in view."""
        low, high = self.view_range
        if about is None:
            about = self.line_at if low <= self.line_at <= high else (low + high) / 2
        self.show_range(about - (about - low) * factor, about + (high - about) * factor)

    def pan(self, by: float) -> None:
        """Move the view to the right; to the left where `by` is negative."""
        low, high = self.view_range
        self.show_range(low + by, high + by)

    def wheelEvent(self, event: QWheelEvent) -> None:
        turn, (low, high) = event.angleDelta(), self.view_range
        if turn.y():
            self.zoom(ZOOM_STEP ** (-turn.y() / 120), self.place_at(event.position()).x())
        if turn.x():
            self.pan(-turn.x() / 120 * 0.1 * (high - low))
        event.accept()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self.setFocus(Qt.FocusReason.MouseFocusReason)
        if event.button() & self.PAN_BUTTONS:
            self._pan_from = event.position().x()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if event.buttons() & self.PAN_BUTTONS and self._pan_from is not None:
            at = event.position()
            shift = self.place_at(QPointF(self._pan_from, at.y())).x() - self.place_at(at).x()
            self._pan_from = at.x()
            self.pan(shift)
        self._hover(event.position())

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self._pan_from = None

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        self.show_all()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Ask for another place of the line by arrows and Home; zoom by + and −, show all by 0."""
        low, high = self.view_range
        here = self.line_at if math.isfinite(self.line_at) else low
        step = min(self.LONGEST_STEP, LINE_STEP * (high - low))
        match event.key():
            case Qt.Key.Key_Left:
                self._seek(here - step)
            case Qt.Key.Key_Right:
                self._seek(here + step)
            case Qt.Key.Key_Home:
                self._seek(self._ends[0])
            case Qt.Key.Key_Plus | Qt.Key.Key_Equal:
                self.zoom(1 / ZOOM_STEP**2)
            case Qt.Key.Key_Minus:
                self.zoom(ZOOM_STEP**2)
            case Qt.Key.Key_0:
                self.show_all()
            case _:
                super().keyPressEvent(event)

    def _seek(self, at: float) -> None:
        """Ask for a place of the line, limited to the ends of the axis."""
        self.seek_asked.emit(min(max(at, self._ends[0]), self._ends[1]))
