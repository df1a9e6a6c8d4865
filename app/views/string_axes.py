"""Where things stand in the picture of the string: lengths and mm to pixels, and back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from pyqtgraph.functions import create_qpolygonf, ndarray_from_qpolygonf
from PySide6.QtCore import QPointF
from PySide6.QtGui import QPolygonF

MARGIN_X = 46
MARGIN_TOP = 38
MARGIN_BOTTOM = 40


@dataclass(frozen=True)
class StringAxes:
    """The axes in a widget of `width` × `height` pixels; `span_mm` is the half height."""

    width: int
    height: int
    span_mm: float

    @property
    def length(self) -> float:
        """Of the string, in pixels."""
        return max(1.0, self.width - 2 * MARGIN_X)

    @property
    def top(self) -> float:
        return MARGIN_TOP

    @property
    def bottom(self) -> float:
        return self.height - MARGIN_BOTTOM

    @property
    def middle(self) -> float:
        return (self.top + self.bottom) / 2

    @property
    def half_height(self) -> float:
        return max(1.0, (self.bottom - self.top) / 2)

    def x(self, position: float) -> float:
        return MARGIN_X + position * self.length

    def y(self, displacement_mm: float) -> float:
        return self.middle - displacement_mm / self.span_mm * self.half_height

    def at(self, position: float, displacement_mm: float) -> QPointF:
        return QPointF(self.x(position), self.y(displacement_mm))

    def position(self, x: float) -> float:
        return (x - MARGIN_X) / self.length

    def displacement_mm(self, y: float) -> float:
        return (self.middle - y) / self.half_height * self.span_mm

    def curve(self, displacement_mm: NDArray[np.floating]) -> QPolygonF:
        """A line through (points,) displacements from end to end."""
        polygon = create_qpolygonf(len(displacement_mm))
        self._fill(ndarray_from_qpolygonf(polygon), displacement_mm)
        return polygon

    def band(self, lowest_mm: NDArray[np.floating], highest_mm: NDArray[np.floating]) -> QPolygonF:
        """The area between two lines."""
        points = len(lowest_mm)
        polygon = create_qpolygonf(2 * points)
        corners = ndarray_from_qpolygonf(polygon)
        self._fill(corners[:points], lowest_mm)
        self._fill(corners[points:], highest_mm)
        corners[points:] = corners[points:][::-1].copy()
        return polygon

    def _fill(self, corners: NDArray[np.float64], displacement_mm: NDArray[np.floating]) -> None:
        corners[:, 0] = _places(self.x(0), self.x(1), len(corners))
        corners[:, 1] = self.middle - displacement_mm * (self.half_height / self.span_mm)


@lru_cache(maxsize=4)
def _places(first: float, last: float, points: int) -> NDArray[np.float64]:
    return np.linspace(first, last, points)
