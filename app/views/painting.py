"""Pens, brushes and words of painted widgets, in the colours of the theme."""

from __future__ import annotations

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QFont, QGradient, QPainter, QPen

Colour = str | QColor
CENTRE = Qt.AlignmentFlag.AlignCenter


def set_ink(
    painter: QPainter, line: Colour | None = None, width: float = 1.0, fill: Colour | QGradient | None = None
) -> None:
    """Set pen and brush, None for no line or nothing within; `width` of the line in pixels."""
    painter.setPen(Qt.PenStyle.NoPen if line is None else QPen(QColor(line), width))
    filling = QColor(fill) if isinstance(fill, str) else fill
    painter.setBrush(Qt.BrushStyle.NoBrush if filling is None else filling)


def write(
    painter: QPainter,
    place: QRectF,
    words: str,
    colour: Colour,
    font: QFont,
    align: Qt.AlignmentFlag = CENTRE,
    room: float | None = None,
) -> None:
    """Write a line of words; what is longer than `room`, in pixels, ends with an ellipsis."""
    painter.setPen(QColor(colour))
    painter.setFont(font)
    if room is not None:
        words = painter.fontMetrics().elidedText(words, Qt.TextElideMode.ElideRight, int(room))
    painter.drawText(place, align, words)
