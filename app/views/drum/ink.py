"""The picture of a drum: its displacement in colours, its edge, its strike, and its listening points."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QLineF, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPen

from app.session.shown import ShownSource, readable_unit
from app.views import theme
from app.views.drum.axes import HeadAxes, Place
from app.views.stage import MARGIN_X, paint_labels, paint_mark

COLOURS = 511  # odd: the middle one is rest
STEPS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)  # of a colour scale, in each decade
LEAST_M = 1e-15  # of a colour scale
LOOSE = 1.4  # a scale shrinks only where the motion has so much room
PLACE_RADIUS = 6.0
FOOT_WORDS = 70  # pixels: room on the left of a foot for its words


@dataclass(frozen=True)
class HeadFrame:
    """The drum at one moment.

    Attributes:
        pictures_m: by source, displacement on a grid (rows, columns), the first row at the top.
        caption: the time, and the slow motion's speed.
    """

    pictures_m: Mapping[str, NDArray[np.float32]]
    caption: str = ""


def fitting_scale_m(largest_m: float, air: float = 1.0) -> float:
    """The least of the round numbers that is at least `air` times a displacement."""
    least_m = max(largest_m * air, LEAST_M)
    decade = 10.0 ** math.floor(math.log10(least_m))
    return next((step * decade for step in STEPS if step * decade >= least_m * (1 - 1e-9)), 10 * decade)


def kept_scale_m(largest_m: float, before_m: float) -> float:
    """The scale as `fitting_scale_m`; one that is only a little too large stays."""
    return max(fitting_scale_m(largest_m), min(before_m, fitting_scale_m(largest_m, LOOSE)))


def image_of(picture_m: NDArray[np.float32], scale_m: float) -> QImage:
    """Displacement in colours: amber up, blue down, the panel's colour at rest."""
    half = COLOURS // 2
    index = np.clip(np.rint(picture_m * np.float32(half / scale_m)), -half, half).astype(np.intp) + half
    colours = np.ascontiguousarray(_colours(theme.TRUTH, theme.PANEL, theme.MODEL)[index])
    rows, columns = colours.shape
    return QImage(colours.data, columns, rows, 4 * columns, QImage.Format.Format_RGB32).copy()


@lru_cache(maxsize=4)
def _colours(*ends_and_rest: str) -> NDArray[np.uint32]:
    """The colours (COLOURS,) as 0xffRRGGBB, evenly between the colours of down, rest and up."""
    colours = [QColor(name) for name in ends_and_rest]
    stops = np.array([(colour.red(), colour.green(), colour.blue()) for colour in colours], np.float64)
    places = np.linspace(-1, 1, COLOURS)
    red, green, blue = (np.rint(np.interp(places, (-1, 0, 1), part)).astype(np.uint32) for part in stops.T)
    return np.asarray(0xFF000000 | red << 16 | green << 8 | blue, np.uint32)


def paint_motion(
    painter: QPainter, axes: HeadAxes, head: int, picture_m: NDArray[np.float32], scale_m: float
) -> None:
    """Paint the colours of a picture within the drum's edge; its outer points lie on the edge."""
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


def paint_edge(painter: QPainter, axes: HeadAxes, head: int, source: ShownSource | None) -> None:
    """Paint the edge in the colour of its source; a bar is held at its ends alone."""
    colour = theme.FAINT if source is None else theme.SOURCE_COLOURS[theme.source_kind(source.source)]
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.setPen(QPen(QColor(colour), 2.5))
    if axes.shape != "bar":
        painter.drawPath(axes.outline(head))
        return
    area = axes.rect(head)
    painter.setPen(QPen(theme.translucent(colour, 110), 1))
    painter.drawRect(area)
    painter.setPen(QPen(QColor(colour), 4))
    for x in (area.left(), area.right()):
        painter.drawLine(QLineF(x, area.top() - 3, x, area.bottom() + 3))


def paint_scale(painter: QPainter, axes: HeadAxes, head: int, scale_m: float) -> None:
    """Paint the value of the strongest colours below a picture."""
    factor, unit = readable_unit(scale_m, "displacement")
    area = axes.rect(head)
    painter.setFont(theme.small_font(10))
    painter.setPen(QColor(theme.FAINT))
    place = QRectF(area.left(), area.bottom() + 4, area.width(), 16)
    painter.drawText(place, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignTop, f"± {factor * scale_m:g} {unit}")


def paint_place(painter: QPainter, at: QPointF, clear: bool) -> None:
    """Paint the place of the strike, a ring with a dot; `clear` with the keyboard or the pointer on the drum."""
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.setPen(QPen(QColor(theme.BACKGROUND), 3.5))
    painter.drawEllipse(at, PLACE_RADIUS, PLACE_RADIUS)
    painter.setPen(QPen(theme.translucent(theme.TEXT, 255 if clear else 150), 1.5))
    painter.drawEllipse(at, PLACE_RADIUS, PLACE_RADIUS)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(theme.translucent(theme.TEXT, 255 if clear else 150))
    painter.drawEllipse(at, 1.8, 1.8)


def paint_listening(painter: QPainter, axes: HeadAxes, points: Mapping[str, float], grabbed: str | None) -> None:
    """Paint the directions that the drum is heard from, as feet below the first picture, with their angles."""
    for side, point in points.items():
        x, y = axes.x(0, point), axes.bottom
        painter.setPen(QPen(theme.translucent(theme.GOOD, 190 if side == grabbed else 120), 1))
        painter.drawLine(QLineF(x, y - 8, x, y + 2))
        paint_mark(painter, x, y, side == grabbed)
    names = {side: "listen" if len(points) == 1 else f"{side[0].upper()}:" for side in points}
    labels = [(axes.x(0, point), f"{names[side]} {angle_words(point)}") for side, point in points.items()]
    paint_labels(painter, labels, axes.width, axes.bottom)


def angle_words(point: float) -> str:
    """A listening point as an angle from the axis of the drum. The point is the sine of it, from 0 to 1."""
    degrees = round(math.degrees(math.asin(min(max(2 * point - 1, -1.0), 1.0))))
    if degrees == 0:
        return "above"
    return f"{abs(degrees)}° {'left' if degrees < 0 else 'right'}"


def paint_caption(painter: QPainter, axes: HeadAxes, text: str) -> None:
    """Paint the time that is shown, in the lower right corner."""
    painter.setFont(theme.small_font(12))
    painter.setPen(QColor(theme.TEXT))
    area = QRectF(MARGIN_X, axes.height - 22, axes.width - 2 * MARGIN_X, 18)
    painter.drawText(area, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter, text)


def paint_name(painter: QPainter, axes: HeadAxes, text: str, points: Mapping[str, float]) -> None:
    """Paint the drum's name in the lower left corner, as far as the words of the listening points."""
    painter.setFont(theme.small_font(12))
    painter.setPen(QColor(theme.FAINT))
    first = min((axes.x(0, point) for point in points.values()), default=float(axes.width))
    room = max(axes.rect(0).left() - MARGIN_X / 2, first - theme.px(FOOT_WORDS) - MARGIN_X / 2, 0.0)
    cut = painter.fontMetrics().elidedText(text, Qt.TextElideMode.ElideRight, int(room))
    painter.drawText(QRectF(MARGIN_X / 2, axes.height - 22, room, 18), Qt.AlignmentFlag.AlignVCenter, cut)


def place_words(place: Place) -> str:
    return f"{place[0]:+.2f}, {place[1]:+.2f}"
