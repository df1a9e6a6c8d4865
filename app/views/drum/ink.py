"""The picture of a drum: its displacement in colours, its edge, its strike, and its listening points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QLineF, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter

from app.session.shown import readable_unit
from app.views import theme
from app.views.drum.axes import HeadAxes, Place
from app.views.painting import set_ink, write
from app.views.stage import MARGIN_X

COLOURS = 511  # odd: the middle one is rest
STEPS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)  # of a colour scale, in each decade
LEAST_M = 1e-15  # displacement of a full colour, at least
LOOSE = 1.4  # times the largest displacement: a scale shrinks only from above this
PLACE_RADIUS = 6.0  # pixels: of the mark of the strike
FOOT_WORDS = 70  # pixels: room on the left of a foot for its words


@dataclass(frozen=True)
class HeadFrame:
    """The drum at one moment.

    Attributes:
        pictures_m: by source, displacement in m on a grid (rows, columns), the first row at the top.
        caption: the time, and the slow motion's speed.
    """

    pictures_m: Mapping[str, NDArray[np.float32]]
    caption: str = ""


def fitting_scale_m(largest_m: float, air: float = 1.0) -> float:
    """The displacement of the full colour: the least round number, STEPS × 10ⁿ m, from `air` times the largest on."""
    least_m = max(largest_m * air, LEAST_M)
    decade = 10.0 ** math.floor(math.log10(least_m))
    return next((step * decade for step in STEPS if step * decade >= least_m * (1 - 1e-9)), 10 * decade)


def kept_scale_m(largest_m: float, before_m: float) -> float:
    """The scale as `fitting_scale_m`; `before_m`, the scale so far (0: none), stays where it fits loosely."""
    return max(fitting_scale_m(largest_m), min(before_m, fitting_scale_m(largest_m, LOOSE)))


def image_of(picture_m: NDArray[np.float32], scale_m: float) -> QImage:
    """The image of displacements in m, (rows, columns): amber up, blue down, the panel's colour at rest.

    `scale_m`: the displacement of the full colour, also of what lies beyond.
    """
    half = COLOURS // 2
    index = np.clip(np.rint(picture_m * np.float32(half / scale_m)), -half, half).astype(np.intp) + half
    # 0xffRRGGBB, (rows, columns)
    colours = np.ascontiguousarray(_colours(theme.TRUTH, theme.PANEL, theme.MODEL)[index])
    rows, columns = colours.shape
    return QImage(colours.data, columns, rows, 4 * columns, QImage.Format.Format_RGB32).copy()


@lru_cache(maxsize=4)
def _colours(*ends_and_rest: str) -> NDArray[np.uint32]:
    """The colours (COLOURS,) as 0xffRRGGBB, evenly between the three named colours: of down, rest and up."""
    colours = [QColor(name) for name in ends_and_rest]
    # (down rest up, red green blue), 0 … 255
    stops = np.array([(colour.red(), colour.green(), colour.blue()) for colour in colours], np.float64)
    places = np.linspace(-1, 1, COLOURS)
    red, green, blue = (np.rint(np.interp(places, (-1, 0, 1), part)).astype(np.uint32) for part in stops.T)
    return np.asarray(0xFF000000 | red << 16 | green << 8 | blue, np.uint32)


def paint_motion(
    painter: QPainter, axes: HeadAxes, head: int, picture_m: NDArray[np.float32], scale_m: float
) -> None:
    """Paint displacements in m, (rows, columns), as colours within the drum's edge; outer points lie on the edge.

    `scale_m`: the displacement of the full colour.
    """
    area, (rows, columns) = axes.rect(head), picture_m.shape
    aside, above = area.width() / (columns - 1) / 2, area.height() / (rows - 1) / 2
    painter.save()
    painter.setClipPath(axes.outline(head))
    painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
    painter.drawImage(area.adjusted(-aside, -above, aside, above), image_of(picture_m, scale_m))
    painter.restore()


def paint_rest(painter: QPainter, axes: HeadAxes, head: int) -> None:
    """Paint the drum at rest."""
    painter.fillPath(axes.outline(head), QColor(theme.PANEL))


def paint_edge(painter: QPainter, axes: HeadAxes, head: int, source: str) -> None:
    """Paint the edge in the colour of its source; a bar is held at its ends alone."""
    colour = theme.SOURCE_COLOURS[theme.source_kind(source)]
    if axes.shape != "bar":
        set_ink(painter, colour, 2.5)
        painter.drawPath(axes.outline(head))
        return
    area = axes.rect(head)
    set_ink(painter, theme.translucent(colour, 110))
    painter.drawRect(area)
    set_ink(painter, colour, 4)
    for x in (area.left(), area.right()):
        painter.drawLine(QLineF(x, area.top() - 3, x, area.bottom() + 3))


def paint_scale(painter: QPainter, axes: HeadAxes, head: int, scale_m: float) -> None:
    """Paint the value of the strongest colours below a picture."""
    factor, unit = readable_unit(scale_m, "displacement")
    area = axes.rect(head)
    place = QRectF(area.left(), area.bottom() + 4, area.width(), 16)
    align = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignTop
    write(painter, place, f"± {factor * scale_m:g} {unit}", theme.FAINT, theme.small_font(10), align)


def paint_place(painter: QPainter, at: QPointF, clear: bool) -> None:
    """Paint the place of the strike, a ring with a dot, at a point in pixels; `clear`: opaque, else translucent."""
    colour = theme.translucent(theme.TEXT, 255 if clear else 150)
    for ring, width in ((theme.BACKGROUND, 3.5), (colour, 1.5)):
        set_ink(painter, ring, width)
        painter.drawEllipse(at, PLACE_RADIUS, PLACE_RADIUS)
    set_ink(painter, fill=colour)
    painter.drawEllipse(at, 1.8, 1.8)


def angle_words(point: float) -> str:
    """A listening point, 0 … 1, as an angle from the axis of the drum: 0 is 90° left, 0.5 above, 1 is 90° right."""
    degrees = round(math.degrees(math.asin(min(max(2 * point - 1, -1.0), 1.0))))
    if degrees == 0:
        return "above"
    return f"{abs(degrees)}° {'left' if degrees < 0 else 'right'}"


def paint_name(painter: QPainter, axes: HeadAxes, text: str, points: Iterable[float]) -> None:
    """Paint the drum's name in the lower left corner, cut before the words of the listening points, 0 … 1."""
    first = min(map(axes.x, points), default=float(axes.width))
    room = max(axes.rect(0).left() - MARGIN_X / 2, first - theme.px(FOOT_WORDS) - MARGIN_X / 2, 0.0)
    place = QRectF(MARGIN_X / 2, axes.height - 22, room, 18)
    write(painter, place, text, theme.FAINT, theme.small_font(12), Qt.AlignmentFlag.AlignVCenter, room)


def place_words(place: Place) -> str:
    return f"{place[0]:+.2f}, {place[1]:+.2f}"
