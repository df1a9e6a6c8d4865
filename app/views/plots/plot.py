"""A plot of the panels: named, reached by Tab, its axes fit their room, and it says where the mouse points."""

from __future__ import annotations

import math
from typing import ClassVar

import pyqtgraph as pg
from PySide6.QtCore import QEvent, QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QMouseEvent, QPainter, QPainterPath, QResizeEvent

from app.views.controls.parts import keeps_keys
from app.views.plots.axis_label import UprightLabel, UprightTicks
from app.views.plots.legend import Legend

LABELLED_HEIGHT = 170  # pixels: a lower plot shows no label beneath it
_NO_CACHE, _CACHE = pg.GraphicsObject.CacheMode.NoCache, pg.GraphicsObject.CacheMode.DeviceCoordinateCache
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
            item.getAxis(side).setCacheMode(_CACHE)
        item.setLabel("bottom", foot)
        self.label = UprightLabel(item)
        self.ticks = UprightTicks(item.getAxis("left"), item.vb)

    def place_at(self, at: QPointF) -> QPointF:
        """The values of both axes at a place of the widget."""
        return self.getPlotItem().vb.mapSceneToView(self.mapToScene(at.toPoint()))

    def fit_foot(self) -> None:
        """Show the label beneath only where there is room; to be called when it is another one."""
        self.getPlotItem().getAxis("bottom").showLabel(self.height() >= LABELLED_HEIGHT)

    def paint_figure(self, painter: QPainter) -> None:
        """Paint the plot and its legend, without the line that moves.

        Lines at data are painted last, in pixels: a vector file would scale their pens and round their places.
        """
        box = self.getPlotItem().vb
        things = [each for each in self.scene().items(Qt.SortOrder.AscendingOrder) if box.isAncestorOf(each)]
        curves = [each for each in things if isinstance(each, pg.PlotCurveItem) and each.opts["fillLevel"] is None]
        lines = [*curves, *(each for each in things if isinstance(each, pg.InfiniteLine))]
        self.getPlotItem().layout.activate()
        for for_file in (True, False):  # axes and points as vectors, lines not yet; then all as the screen needs it
            for side in ("left", "bottom"):
                self.getPlotItem().getAxis(side).setCacheMode(_NO_CACHE if for_file else _CACHE)
            for line in lines:
                line.setFlag(line.GraphicsItemFlag.ItemHasNoContents, for_file)
            for points in (each for each in things if isinstance(each, pg.ScatterPlotItem)):
                points.setExportMode(for_file)
            if for_file:
                self.render(painter, QRectF(self.viewport().rect()), self.viewport().rect())
        painter.save()
        painter.setClipRect(box.sceneBoundingRect())
        for line in filter(pg.GraphicsObject.isVisible, lines):
            if isinstance(line, pg.InfiniteLine):
                path, pen = QPainterPath(QPointF(line.boundingRect().left(), 0.0)), line.currentPen
                path.lineTo(line.boundingRect().right(), 0.0)
            else:
                path, pen = line.getPath(), pg.mkPen(line.opts["pen"])
            painter.strokePath(line.sceneTransform().map(path), pen)
        painter.restore()
        for legend in self.findChildren(Legend):
            legend.render(painter, legend.pos(), renderFlags=legend.RenderFlag(0))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        super().mouseMoveEvent(event)
        self._hover(event.position())

    def _hover(self, at: QPointF) -> None:
        """Emit the values of both axes at a point of the widget, in pixels; NaN outside the axes."""
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
