"""The picture of the string itself: its motion, the pluck with its handle, the ends, and the listening points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QLine, QLineF, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFontMetrics, QLinearGradient, QPainter, QPen, QPolygonF

from app.analysis.moment import Band, StringFrame
from app.views import theme
from app.views.painting import set_ink, write
from app.views.string.axes import StringAxes
from app.views.string.ground import paint_grid

HANDLE_RADIUS = 7.0  # pixels
DASH = 4  # pixels
PIECE, EVERY = 9, 24  # pixels: length and spacing of the pieces of a hidden line that are drawn above the other
MERGED = 2.0  # pixels: of two lines that are nearer, one hides the other


@dataclass(frozen=True)
class ShownPluck:
    """The pluck as chosen: position 0 … 1 along the string, amplitude and displacement in mm.

    `label`: its shape and width in words.
    """

    position: float
    amplitude_mm: float
    shape_mm: NDArray[np.float64]  # (points,), evenly from end to end
    label: str = ""


GLOW = ((4.0, 0.25), (2.4, 0.5), (1.2, 0.8))  # pixels from the string on both sides, share of its colour


def paint_motion(painter: QPainter, axes: StringAxes, frame: StringFrame, front: str, glows: bool = False) -> None:
    """Paint a string for each source, `front` above the others, and above it pieces of those it hides.

    `front`: the name of the source that sounds. `glows`: with light around the strings, without the grid.

    Opaque fills and thin pens only: this is drawn sixty times a second.
    """
    order = sorted(frame.shapes, key=lambda name: name == front)
    painter.setClipRect(QRectF(axes.at(0, axes.span_mm), axes.at(1, -axes.span_mm)))
    for name in order:
        _paint_band(painter, axes, frame.blurs[name], name, 0.24 if name == front else 0.18)
    if not glows:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
        paint_grid(painter, axes)  # the opaque bands have covered it
    painter.setRenderHint(QPainter.RenderHint.Antialiasing, True)
    for name in order:
        for far, share in GLOW if glows else ():
            set_ink(painter, theme.blended(_hue(name), theme.PANEL, share))
            for shift in (-far, far):
                painter.drawPolyline(axes.curve(frame.shapes[name]).translated(0, shift))
        set_ink(painter, _hue(name))
        curve = axes.curve(frame.shapes[name])
        for shift in (-0.8, 0.0, 0.8) if name == front else (-0.4, 0.4):  # wider pens are ten times slower
            painter.drawPolyline(curve.translated(0, shift))
    for name in order[:-1]:
        pieces = _hidden_pieces(axes, frame.shapes[name], frame.shapes[order[-1]])
        set_ink(painter, _hue(name))
        for shift in (-0.6, 0.6) if pieces else ():
            painter.translate(0, shift)
            painter.drawLines(pieces)
            painter.translate(0, -shift)
    painter.setClipping(False)


def _hidden_pieces(axes: StringAxes, below: NDArray[np.float32], above: NDArray[np.float32]) -> list[QLineF]:
    """Short parts of a line under another, which make both a line of two colours; they stand still as it moves."""
    starts = np.arange(EVERY / 2, axes.length - PIECE, EVERY)
    ends = starts + PIECE
    firsts, lasts = (_heights(axes, below, at) for at in (starts, ends))
    apart = np.maximum(np.abs(firsts - _heights(axes, above, starts)), np.abs(lasts - _heights(axes, above, ends)))
    hidden = apart < MERGED
    left = axes.x(0)
    corners = (left + starts[hidden], firsts[hidden], left + ends[hidden], lasts[hidden])
    return [QLineF(*piece) for piece in zip(*(values.tolist() for values in corners), strict=True)]


def _heights(axes: StringAxes, shape_mm: NDArray[np.float32], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """The y of the line at distances from the string's left end, both in pixels."""
    points = np.linspace(0, axes.length, len(shape_mm))
    return axes.middle - np.interp(at, points, shape_mm) * (axes.half_height / axes.span_mm)


def paint_envelopes(painter: QPainter, axes: StringAxes, envelopes: Mapping[str, Band], front: str) -> None:
    """Paint the envelopes, which lie behind the motion and change less often."""
    painter.setClipRect(QRectF(axes.at(0, axes.span_mm), axes.at(1, -axes.span_mm)))
    for name in sorted(envelopes, key=lambda name: name == front):
        _paint_band(painter, axes, envelopes[name], name, 0.07)


def _paint_band(painter: QPainter, axes: StringAxes, band: Band, name: str, strength: float) -> None:
    """Paint the area between two lines of displacement, in a source's colour mixed with the ground.

    `strength`: the share of the colour, 0 … 1. Thin edges show its extent where another band covers it in part.
    """
    colour = _hue(name)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
    set_ink(painter, fill=theme.blended(colour, theme.PANEL, strength))
    area, *edges = axes.band(*band)
    painter.drawPolygon(area)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing, True)
    set_ink(painter, theme.blended(colour, theme.PANEL, 3 * strength))
    for edge in edges:
        painter.drawPolyline(edge)


def paint_pluck(painter: QPainter, axes: StringAxes, pluck: ShownPluck) -> None:
    """Paint the string as it is pulled, before its release."""
    curve = axes.curve(pluck.shape_mm)
    area = QPolygonF(curve)
    area.append(axes.at(1, 0))
    area.append(axes.at(0, 0))
    fill = QLinearGradient(0, axes.y(pluck.amplitude_mm), 0, axes.middle)
    fill.setColorAt(0, theme.translucent(theme.TEXT, 60))
    fill.setColorAt(1, theme.translucent(theme.TEXT, 0))
    set_ink(painter, fill=fill)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
    painter.drawPolygon(area)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing, True)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.setPen(QPen(QColor(theme.TEXT), 2.2, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
    painter.drawPolyline(curve)


def paint_handle(painter: QPainter, at: QPointF, pluck: ShownPluck, full: bool, grabbed: bool, right: float) -> None:
    """Paint the handle: `full` on a string at rest, else a ring; with its values where it is full or grabbed.

    `at`, `right`: its middle, and the end of the string that words keep within, in pixels.
    """
    if grabbed:
        set_ink(painter, fill=theme.translucent(theme.TEXT, 50))
        painter.drawEllipse(at, 2 * HANDLE_RADIUS, 2 * HANDLE_RADIUS)
    solid = full or grabbed
    set_ink(painter, theme.BACKGROUND if solid else theme.FAINT, 2, theme.TEXT if solid else QColor(0, 0, 0, 90))
    painter.drawEllipse(at, HANDLE_RADIUS, HANDLE_RADIUS)
    if not solid:
        return
    set_ink(painter, fill=theme.BACKGROUND)
    painter.drawEllipse(at, 2.2, 2.2)
    words = f"at {pluck.position:.2f}   {pluck.amplitude_mm:.1f} mm"
    if pluck.label:
        words += f"   {pluck.label}"
    font = theme.small_font(12)
    length = QFontMetrics(font).horizontalAdvance(words)
    beside = at.x() + 22 if at.x() + 22 + length < right else at.x() - 22 - length
    plate = QRectF(beside - 6, at.y() - 11, length + 12, 22)
    set_ink(painter, fill=theme.translucent(theme.RAISED, 220))
    painter.drawRoundedRect(plate, 4, 4)
    write(painter, plate, words, theme.TEXT, font)


def paint_ends(painter: QPainter, axes: StringAxes) -> None:
    """Paint the places where the string is fixed."""
    set_ink(painter, fill=theme.FAINT)
    for x in (axes.x(0), axes.x(1)):
        painter.drawRoundedRect(QRectF(x - 3, axes.middle - 22, 6, 44), 3, 3)


def paint_listening_line(painter: QPainter, axes: StringAxes, x: float, colour: QColor) -> None:
    painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
    set_ink(painter, colour)
    painter.drawLines(_dashes(round(x), round(axes.top), round(axes.bottom)))
    painter.setRenderHint(QPainter.RenderHint.Antialiasing, True)


def _hue(source: str) -> str:
    return theme.SOURCE_COLOURS[theme.source_kind(source)]


@lru_cache(maxsize=4)
def _dashes(x: int, top: int, bottom: int) -> list[QLine]:
    """A vertical line of dashes: a pen that dashes is a hundred times slower."""
    return [QLine(x, y, x, y + DASH) for y in range(top, bottom - DASH, 2 * DASH)]
