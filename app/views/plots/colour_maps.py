"""Perceptually uniform colour maps (P. Kovesi's, from pyqtgraph) whose neutral colour is that of the panels.

They depend on the theme: a view takes its map again when the theme changes.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pyqtgraph as pg
from PySide6.QtGui import QColor

from app.views import theme

_COLOURS = 511  # odd: one of them is zero


def displacement_map() -> pg.ColorMap:
    """The colours of displacement: below 0 blue, above 0 red, at 0 the background."""
    return _shift_to_ground("CET-D4", 0.5, theme.PANEL)


def error_map() -> pg.ColorMap:
    """Amber where the model lies above the truth, blue where the truth lies above the model."""
    return _shift_to_ground("CET-D6", 0.5, theme.PANEL)


def magnitudes_of(signed: pg.ColorMap) -> pg.ColorMap:
    """The upper half of a map with two signs, for magnitudes."""
    upper = np.linspace(0.5, 1, _COLOURS // 2 + 1)
    return pg.ColorMap(2 * upper - 1, signed.map(upper, mode="byte"))


def level_map() -> pg.ColorMap:
    """The colours of levels: by violet and amber to white; in the light theme by amber and red to dark blue."""
    return _shift_to_ground("inferno" if theme.is_dark() else "CET-L17", 0.0, theme.PANEL)


def share_map() -> pg.ColorMap:
    """The colours of shares, by lightness alone too: near the background at 0, the strongest contrast at 1."""
    dark = ["#10202e", "#1d5a78", "#8a6f52", "#f0a63c", "#fff1d6"]
    light = ["#f2f6f9", "#a9cde0", "#d8b287", "#b5650b", "#4a2300"]
    return pg.ColorMap([0, 0.3, 0.55, 0.78, 1], dark if theme.is_dark() else light, mapping="clip")


@lru_cache
def _shift_to_ground(name: str, ground_at: float, panel: str) -> pg.ColorMap:
    """The pyqtgraph map, shifted so that its colour at `ground_at` (0 … 1) is `panel`; its ends keep theirs."""
    places = np.linspace(0, 1, _COLOURS)
    source = pg.colormap.get(name)
    colours = np.asarray(source.map(places, mode="float"))[:, :3]  # (places, red green blue), 0 … 1
    ground = np.array(QColor(panel).getRgbF()[:3])  # type: ignore[index]
    dark = np.asarray(source.map(ground_at, mode="float"))[:3]
    nearness = 1 - np.abs(places - ground_at) / max(ground_at, 1 - ground_at)
    shifted_colours = np.clip(colours + (ground - dark) * nearness[:, None], 0, 1)
    return pg.ColorMap(places, (255 * shifted_colours).round().astype(np.uint8))
