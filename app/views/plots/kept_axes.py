"""Axes whose picture is kept: numbers and grid stay while curves move."""

from __future__ import annotations

import pyqtgraph as pg


def keep_axes(plot: pg.PlotItem) -> None:
    """Draws them anew only where they have changed: they are most of a painting, which a key may have to wait for."""
    for side in ("left", "bottom"):
        plot.getAxis(side).setCacheMode(pg.GraphicsObject.CacheMode.DeviceCoordinateCache)
