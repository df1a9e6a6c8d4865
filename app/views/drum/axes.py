"""The axes of a drum's picture: places on its head and directions of listening to pixels, and back."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QPainterPath

from app.views.stage import MARGIN_TOP, MARGIN_X, StageAxes

Shape = Literal["circle", "rectangle", "bar"]
Place = tuple[float, float]  # x, y from the centre in half-lengths: -1 … 1, y upwards
GAP = 36  # pixels between two pictures
RIM = 0.98  # half-lengths from the centre: farther out it is not struck, for there nothing moves
FLATTEST = 0.12  # least height of a picture, as a share of its width: bars are drawn wider than they are


@dataclass(frozen=True)
class HeadAxes(StageAxes):
    """Pictures of one drum, side by side: one for each source, such as the model. `head` is its number from the left.

    Places are given from the centre, in half-lengths, and y points up. Listening points are 0 … 1 from left to right,
    beneath the first picture.

    Attributes:
        sides: length and width of the drum, in any unit.
        heads: how many pictures there are.
    """

    shape: Shape = "circle"
    sides: tuple[float, float] = (1.0, 1.0)
    heads: int = 1

    def rect(self, head: int) -> QRectF:
        """The box of a picture, in pixels of the widget, with the ratio of the drum's sides."""
        count = max(1, self.heads)
        room_x = (self.width - 2 * MARGIN_X - (count - 1) * GAP) / count
        room_y = self.bottom - MARGIN_TOP - 8
        ratio = max(self.sides[1] / self.sides[0], FLATTEST)
        across = max(8.0, min(room_x, room_y / ratio))
        middle_x = MARGIN_X + (head + 0.5) * room_x + head * GAP
        middle_y = MARGIN_TOP + room_y / 2
        return QRectF(middle_x - across / 2, middle_y - across * ratio / 2, across, across * ratio)

    def outline(self, head: int) -> QPainterPath:
        """The edge of the drum in a picture, in pixels."""
        path = QPainterPath()
        if self.shape == "circle":
            path.addEllipse(self.rect(head))
        else:
            path.addRect(self.rect(head))
        return path

    def at(self, head: int, place: Place) -> QPointF:
        """The point of a place in a picture, in pixels."""
        area = self.rect(head)
        x, y = place
        return QPointF(area.center().x() + x * area.width() / 2, area.center().y() - y * area.height() / 2)

    def place(self, at: QPointF) -> Place | None:
        """The place under a point, on whichever picture; None where no drum can be struck."""
        for head in range(self.heads):
            area = self.rect(head)
            x = (at.x() - area.center().x()) / (area.width() / 2)
            y = (area.center().y() - at.y()) / (area.height() / 2)
            if self.holds((x, y)):
                return x, y
        return None

    def holds(self, place: Place) -> bool:
        """Return True if a drum can be struck at a place: within RIM of its centre, in half-lengths."""
        x, y = place
        away = math.hypot(x, y) if self.shape == "circle" else max(abs(x), abs(y))
        return away <= RIM

    def x(self, point: float) -> float:
        area = self.rect(0)
        return area.left() + point * area.width()
