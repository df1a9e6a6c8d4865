"""The parts that all plots share: the colours of background and axes, and their change with the theme.

A plot keeps the pens and brushes that it was made with. When the theme changes, the colour of the same role in
the new one replaces each old one, which leaves its alpha. So no view needs to follow the theme.
"""

from __future__ import annotations

from typing import Any

import pyqtgraph as pg
from PySide6.QtGui import QBrush, QColor, QPen
from PySide6.QtWidgets import QApplication

from app.views import theme


def dress_plots() -> None:
    """Set the options of plots made from now on, and let all plots follow the theme. To be called once."""
    pg.setConfigOptions(antialias=True, useOpenGL=False)
    _set_ground()
    theme.changes.theme_changed.connect(recolour)


def recolour(old: theme.Theme, new: theme.Theme) -> None:
    """Exchange the colours of every plot there is."""
    _set_ground()
    swap = _Swap(old, new)
    for view in QApplication.allWidgets():
        if isinstance(view, pg.GraphicsView):
            view.setBackground("default")
            for item in view.scene().items():
                _recolour_item(item, swap)


def _set_ground() -> None:
    pg.setConfigOptions(background=theme.PANEL, foreground=theme.FAINT)


class _Swap:
    """Colours of one theme for those of another; any other colour stays."""

    def __init__(self, old: theme.Theme, new: theme.Theme) -> None:
        pairs = zip(old.colours.values(), new.colours.values(), strict=True)
        self._colours = {QColor(a).rgb(): QColor(b) for a, b in pairs}

    def colour(self, colour: QColor) -> QColor:
        opaque = QColor(colour)
        opaque.setAlpha(255)
        swapped = QColor(self._colours.get(opaque.rgb(), colour))
        swapped.setAlpha(colour.alpha())
        return swapped

    def pen(self, colour: Any) -> QPen:
        pen = QPen(pg.mkPen(colour))
        pen.setColor(self.colour(pen.color()))
        return pen

    def brush(self, colour: Any) -> QBrush:
        brush = QBrush(pg.mkBrush(colour))
        brush.setColor(self.colour(brush.color()))
        return brush


def _recolour_item(item: Any, swap: _Swap) -> None:
    """Exchange the pens and brushes of one item of a plot; parts of a PlotDataItem follow that."""
    match item:
        case pg.PlotDataItem():
            item.setPen(swap.pen(item.opts["pen"]))
            if item.opts["fillBrush"] is not None:
                item.setFillBrush(swap.brush(item.opts["fillBrush"]))
            item.setSymbolPen(swap.pen(item.opts["symbolPen"]))
            item.setSymbolBrush(swap.brush(item.opts["symbolBrush"]))
        case pg.PlotCurveItem() | pg.ScatterPlotItem() if not isinstance(item.parentItem(), pg.PlotDataItem):
            item.setPen(swap.pen(item.opts["pen"]))
            if item.opts["brush"] is not None:
                item.setBrush(swap.brush(item.opts["brush"]))
        case pg.InfiniteLine():
            item.setPen(swap.pen(item.pen))
            item.setHoverPen(swap.pen(item.hoverPen))
        case pg.LinearRegionItem():
            item.setBrush(swap.brush(item.brush))
            item.setHoverBrush(swap.brush(item.hoverBrush))
        case pg.TextItem():
            item.setColor(swap.colour(item.color))
            item.fill = swap.brush(item.fill)
        case pg.AxisItem():
            item.setPen(swap.pen(item.pen()))
            item.setTextPen(swap.pen(item.textPen()))
    item.update()
