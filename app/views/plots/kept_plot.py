"""A plot with a vertical line that moves over it. Its picture is cached, so that only two strips are painted then."""

from __future__ import annotations

from PySide6.QtCore import QPoint, QPointF, QRect, QRectF
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPixmap, QRegion

from app.views import theme
from app.views.plots.plot import Plot

STRIP = 2  # pixels to either side of the line that are painted with it


class KeptPlot(Plot):
    """A plot with a vertical line, which `move_line` puts at a place on the horizontal axis.

    Where only the line has moved, its old and new strips are painted from a picture of the plot. The picture is made
    when it is first needed after the plot has changed.
    """

    def __init__(self, name: str, tip: str, foot: str = "") -> None:
        self._picture: QPixmap | None = None  # the plot without its line; None: it has changed since
        self._moved = QRegion()  # strips of the line that changed since the last painting
        self._line_at = 0.0  # on the horizontal axis
        self._strip = QRect()  # of the viewport, where the line was drawn last; empty: out of view
        self._next_strip = QRect()  # and where it is to be drawn next
        super().__init__(name, tip, foot)

    @property
    def line_at(self) -> float:
        """The place of the line on the horizontal axis."""
        return self._line_at

    def move_line(self, at: float) -> None:
        """Put the line at a place on the horizontal axis, and repaint the strips where it was and is."""
        self._line_at = at
        self._next_strip = strip = self._line_strip()
        if strip == self._strip:
            return
        for changed in (strip, self._strip):
            self._moved |= QRegion(changed)
            self.viewport().update(changed)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint from the cached picture where only strips of the line have changed, else all; then paint the line."""
        strips, self._moved = self._moved, QRegion()
        if not event.region().subtracted(strips).isEmpty():
            self._picture = None
            self._next_strip = self._line_strip()
            super().paintEvent(event)
            painter = QPainter(self.viewport())
        else:
            if self._picture is None:
                self._picture = self._painted()
            painter = QPainter(self.viewport())
            painter.setClipRegion(event.region())
            painter.drawPixmap(QPoint(), self._picture)
        self._strip = strip = self._next_strip
        if not strip.isEmpty():
            painter.fillRect(strip.adjusted(STRIP, 0, -STRIP, 0), QColor(theme.TEXT))
        painter.end()

    def _painted(self) -> QPixmap:
        """The plot without the line."""
        viewport = self.viewport()
        picture = QPixmap(viewport.size() * self.devicePixelRatioF())
        picture.setDevicePixelRatio(self.devicePixelRatioF())
        painter = QPainter(picture)
        self.render(painter, QRectF(viewport.rect()), viewport.rect())
        painter.end()
        return picture

    def _line_strip(self) -> QRect:
        """The strip of the line in pixels of the viewport; empty where the line is out of view."""
        box = self.getPlotItem().vb
        low, high = box.viewRange()[0]
        if not low <= self._line_at <= high:
            return QRect()
        x = round(self.mapFromScene(box.mapViewToScene(QPointF(self._line_at, 0))).x())
        area = self.mapFromScene(box.sceneBoundingRect()).boundingRect()
        return QRect(x - STRIP, area.top(), 2 * STRIP + 1, area.height())
