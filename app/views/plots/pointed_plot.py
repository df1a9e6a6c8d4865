"""A plot whose points are pointed at by mouse or arrow keys, and taken by a click or Enter."""

from __future__ import annotations

import pyqtgraph as pg
from PySide6.QtCore import QEvent, QPointF, Qt
from PySide6.QtGui import QResizeEvent

from app.views.controls.parts import ENTER_KEYS, keeps_keys
from app.views.plots.axis_label import UprightLabel, UprightTicks, fit_foot

TIP_MS = 3000  # the tooltip covers what is pointed at


class PointedPlot(pg.PlotWidget):
    """The left axis has a label and numbers that fit."""

    def __init__(self, name: str, tip: str) -> None:
        super().__init__(enableMenu=False)
        self.setAccessibleName(name)
        self.setToolTip(tip)
        self.setToolTipDuration(TIP_MS)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        item = self.getPlotItem()
        item.hideButtons()
        item.getAxis("bottom").enableAutoSIPrefix(False)
        self._label = UprightLabel(item)
        self._ticks = UprightTicks(item.getAxis("left"), item.vb)

    def _place_at(self, at: QPointF) -> QPointF:
        """The values of both axes at a place of the widget."""
        return self.getPlotItem().vb.mapSceneToView(self.mapToScene(at.toPoint()))

    def resizeEvent(self, event: QResizeEvent | None) -> None:
        super().resizeEvent(event)
        if self.getPlotItem() is not None:  # it is, while this is being made
            fit_foot(self)

    def event(self, event: QEvent) -> bool:
        """Keep Enter and Esc, which are shortcuts of the window, while the plot has the focus."""
        return keeps_keys(event, *ENTER_KEYS, Qt.Key.Key_Escape) or bool(super().event(event))
