"""A plot of the panels: named, reached by Tab, its axes fit their room, and it says where the mouse points."""

from __future__ import annotations

import math
from typing import ClassVar

import pyqtgraph as pg
from pyqtgraph.graphicsItems.ScatterPlotItem import Symbols
from PySide6.QtCore import QEvent, QLineF, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QMouseEvent, QPainter, QPainterPath, QResizeEvent, QTransform

from app.views.controls.parts import keeps_keys
from app.views.plots.axis_label import UprightLabel, UprightTicks
from app.views.plots.legend import Legend

FIGURE_HEIGHT = 240  # pixels, at least, of a picture
LABELLED_HEIGHT = 170  # pixels: a lower plot shows no label beneath it
INK = pg.PlotCurveItem, pg.InfiniteLine, pg.ScatterPlotItem  # what is drawn at data
TIP_MS = 3000  # the tooltip covers what is pointed at


class Plot(pg.PlotWidget):
    """The left axis has a label and numbers that fit; the one beneath is shown where the plot is high enough."""

    hovered = Signal(float, float)  # the place on the axes that the mouse points at; NaN where it has left them
    KEPT_KEYS: ClassVar[tuple[Qt.Key, ...]] = ()  # shortcuts of the window that are the plot's while it has the focus

    def __init__(self, name: str, tip: str, foot: str = "") -> None:
        super().__init__(enableMenu=False)
        self.setAccessibleName(name)
        self.setToolTip(tip)
        self.setToolTipDuration(TIP_MS)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        item = self.getPlotItem()
        item.hideButtons()
        for side in ("left", "bottom"):
            item.getAxis(side).enableAutoSIPrefix(False)
            # painted again only when it changes: axes are most of a painting, and a key that is played waits for it
            item.getAxis(side).setCacheMode(pg.GraphicsObject.CacheMode.DeviceCoordinateCache)
        item.setLabel("bottom", foot)
        self.label = UprightLabel(item)
        self.ticks = UprightTicks(item.getAxis("left"), item.vb)

    def place_at(self, at: QPointF) -> QPointF:
        """The values of both axes at a place of the widget."""
        return self.getPlotItem().vb.mapSceneToView(self.mapToScene(at.toPoint()))

    def fit_foot(self) -> None:
        """Show the label beneath only where there is room; to be called when it is another one."""
        self.getPlotItem().getAxis("bottom").showLabel(self.height() >= LABELLED_HEIGHT)

    def figure_size(self) -> QSize:
        """The size on the screen; of a low plot higher, so that both axes have their labels."""
        return self.size().expandedTo(QSize(0, FIGURE_HEIGHT))

    def paint_figure(self, painter: QPainter) -> None:
        """Paint the plot and its legend, without the line that moves.

        What is drawn at data is painted last, in pixels: a vector file would scale its pens and round its places.
        """
        item, no_contents = self.getPlotItem(), pg.QtWidgets.QGraphicsItem.GraphicsItemFlag.ItemHasNoContents
        axes = [item.getAxis(side) for side in ("left", "bottom")]
        inks = [each for each in self.scene().items(Qt.SortOrder.AscendingOrder) if isinstance(each, INK)]
        size = self.size()
        self.resize(self.figure_size())
        item.layout.activate()
        for axis in axes:
            axis.setCacheMode(pg.GraphicsObject.CacheMode.NoCache)
        for ink in inks:
            ink.setFlag(no_contents, True)
        self.render(painter, QRectF(self.viewport().rect()), self.viewport().rect())
        for axis in axes:
            axis.setCacheMode(pg.GraphicsObject.CacheMode.DeviceCoordinateCache)
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setClipRect(item.vb.sceneBoundingRect())
        for ink in inks:
            ink.setFlag(no_contents, False)
            if ink.isVisible() and item.vb.isAncestorOf(ink):
                _paint_ink(painter, ink)
        painter.restore()
        for legend in self.findChildren(Legend):
            legend.render(painter, legend.pos(), renderFlags=legend.RenderFlag(0))
        self.resize(size)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        super().mouseMoveEvent(event)
        self._hover(event.position())

    def _hover(self, at: QPointF) -> None:
        inside = self.getPlotItem().vb.sceneBoundingRect().contains(self.mapToScene(at.toPoint()))
        place = self.place_at(at) if inside else QPointF(math.nan, math.nan)
        self.hovered.emit(place.x(), place.y())

    def leaveEvent(self, event: QEvent) -> None:
        self.hovered.emit(math.nan, math.nan)
        super().leaveEvent(event)

    def resizeEvent(self, event: QResizeEvent | None) -> None:
        super().resizeEvent(event)
        if self.getPlotItem() is not None:  # as it is while the plot is being made, and when it has been closed
            self.fit_foot()

    def event(self, event: QEvent) -> bool:
        return keeps_keys(event, *self.KEPT_KEYS) or bool(super().event(event))


def _paint_ink(painter: QPainter, ink: pg.PlotCurveItem | pg.InfiniteLine | pg.ScatterPlotItem) -> None:
    """Paint a curve with the area below it, a line from end to end, or points, in pixels of the plot."""
    in_pixels = ink.sceneTransform()
    if isinstance(ink, pg.InfiniteLine):
        ends = ink.boundingRect()
        painter.setPen(ink.currentPen)
        painter.drawLine(in_pixels.map(QLineF(ends.left(), 0.0, ends.right(), 0.0)))
        return
    if isinstance(ink, pg.ScatterPlotItem):
        for point in ink.points():
            at, size = in_pixels.map(QPointF(point.pos())), point.size()
            painter.setPen(point.pen())
            painter.setBrush(point.brush())
            painter.drawPath(QTransform(size, 0, 0, size, at.x(), at.y()).map(Symbols[point.symbol()]))
        return
    path, level, brush = QPainterPath(ink.getPath()), ink.opts["fillLevel"], ink.opts["brush"]
    if path.isEmpty():
        return
    if level is not None and brush is not None:
        area, first = QPainterPath(path), path.elementAt(0)
        area.lineTo(path.currentPosition().x(), level)
        area.lineTo(first.x, level)
        painter.fillPath(in_pixels.map(area), pg.mkBrush(brush))
    painter.strokePath(in_pixels.map(path), pg.mkPen(ink.opts["pen"]))
