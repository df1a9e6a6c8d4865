"""The axes of the string's picture: positions and displacements to pixels, and back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from pyqtgraph.functions import create_qpolygonf, ndarray_from_qpolygonf
from PySide6.QtCore import QPointF
from PySide6.QtGui import QPolygonF

from app.views.stage import MARGIN_TOP, MARGIN_X, StageAxes


@dataclass(frozen=True)
class StringAxes(StageAxes):
    """The axes of a string; `span_mm` is the half height.

    Positions are shares of the string's length, 0 … 1. `x`, `y` and `at` give pixels of the widget, `position` and
    `displacement_mm` are their inverses.
    """

    span_mm: float

    @property
    def length(self) -> float:
        """The length of the string, in pixels."""
        return max(1.0, self.width - 2 * MARGIN_X)

    @property
    def top(self) -> float:
        return MARGIN_TOP

    @property
    def middle(self) -> float:
        return (self.top + self.bottom) / 2

    @property
    def half_height(self) -> float:
        return max(1.0, (self.bottom - self.top) / 2)

    def x(self, point: float) -> float:
        return MARGIN_X + point * self.length

    def y(self, displacement_mm: float) -> float:
        return self.middle - displacement_mm / self.span_mm * self.half_height

    def at(self, position: float, displacement_mm: float) -> QPointF:
        return QPointF(self.x(position), self.y(displacement_mm))

    def position(self, x: float) -> float:
        return (x - MARGIN_X) / self.length

    def displacement_mm(self, y: float) -> float:
        return (self.middle - y) / self.half_height * self.span_mm

    def curve(self, displacement_mm: NDArray[np.floating]) -> QPolygonF:
        """A line through displacements (points,), evenly spaced from end to end."""
        polygon = create_qpolygonf(len(displacement_mm))
        corners = ndarray_from_qpolygonf(polygon)
        corners[:, 0] = _places(self.x(0), self.x(1), len(corners))
        corners[:, 1] = self.middle - displacement_mm * (self.half_height / self.span_mm)
        return polygon

    def band(
        self, lowest_mm: NDArray[np.floating], highest_mm: NDArray[np.floating]
    ) -> tuple[QPolygonF, QPolygonF, QPolygonF]:
        """The area between two such lines, and both lines."""
        low, high = self.curve(lowest_mm), self.curve(highest_mm)
        area = create_qpolygonf(low.size() + high.size())
        corners = ndarray_from_qpolygonf(area)
        corners[: low.size()] = ndarray_from_qpolygonf(low)
        corners[low.size() :] = ndarray_from_qpolygonf(high)[::-1]
        return area, low, high


@lru_cache(maxsize=4)
def _places(first: float, last: float, points: int) -> NDArray[np.float64]:
    return np.linspace(first, last, points)
