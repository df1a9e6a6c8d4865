"""Perceptually uniform colour maps (P. Kovesi's, from pyqtgraph) whose ground is that of our panels.

They are those of the present face: what draws with one takes it anew when the face changes.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pyqtgraph as pg
from PySide6.QtGui import QColor

from app.views import theme

_COLOURS = 511  # odd: one of them is zero


def displacement_map() -> pg.ColorMap:
    """Down blue, up red, at rest the ground."""
    return _grounded("CET-D4", 0.5, theme.PANEL)


def error_map() -> pg.ColorMap:
    """Amber where the model lies above the truth, blue where the truth lies above the model."""
    return _grounded("CET-D6", 0.5, theme.PANEL)


def magnitudes_of(signed: pg.ColorMap) -> pg.ColorMap:
    """The half of a map with two signs that is above zero."""
    upper = np.linspace(0.5, 1, _COLOURS // 2 + 1)
    return pg.ColorMap(2 * upper - 1, signed.map(upper, mode="byte"))


def level_map() -> pg.ColorMap:
    """From the ground by violet and amber to white; on a light ground by amber and red to dark blue."""
    return _grounded("inferno" if theme.face == theme.DARK else "CET-L17", 0.0, theme.PANEL)


def share_map() -> pg.ColorMap:
    """Of the ground where there is little, further from it the more there is: also without colour."""
    dark = ["#10202e", "#1d5a78", "#8a6f52", "#f0a63c", "#fff1d6"]
    light = ["#f2f6f9", "#a9cde0", "#d8b287", "#b5650b", "#4a2300"]
    return pg.ColorMap([0, 0.3, 0.55, 0.78, 1], dark if theme.face == theme.DARK else light, mapping="clip")


@lru_cache
def _grounded(name: str, ground_at: float, panel: str) -> pg.ColorMap:
    """A map moved in colour such that its place `ground_at` is the panels' ground; its other ends stay."""
    places = np.linspace(0, 1, _COLOURS)
    source = pg.colormap.get(name)
    colours = np.asarray(source.map(places, mode="float"))[:, :3]
    ground = np.array(QColor(panel).getRgbF()[:3])  # type: ignore[index]
    dark = np.asarray(source.map(ground_at, mode="float"))[:3]
    nearness = 1 - np.abs(places - ground_at) / max(ground_at, 1 - ground_at)
    moved = np.clip(colours + (ground - dark) * nearness[:, None], 0, 1)
    return pg.ColorMap(places, (255 * moved).round().astype(np.uint8))
