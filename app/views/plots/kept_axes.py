"""Axes that are drawn from a cache while curves move."""

from __future__ import annotations

import pyqtgraph as pg


def keep_axes(plot: pg.PlotItem) -> None:
    """Draws them anew only when they change: they are most of a painting, and a key that is played waits for it."""
    for side in ("left", "bottom"):
        plot.getAxis(side).setCacheMode(pg.GraphicsObject.CacheMode.DeviceCoordinateCache)
