"""A figure's picture as PNG or SVG: as it is shown, in the colours of the theme."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QBuffer, QIODevice, QRect, QSize
from PySide6.QtGui import QColor, QImage, QPainter
from PySide6.QtSvg import QSvgGenerator

from app.views import theme

LEAST_HEIGHT = 240  # pixels of a picture: enough for the labels of both axes
PIXELS = 2.0  # of a PNG to one of the screen, at least

Figure = Any  # a widget with `paint_figure`, which paints it without what only the screen needs


def picture(figure: Figure, suffix: str) -> bytes:
    """The file of a picture; `suffix`: ".png" or ".svg"."""
    buffer, seen = QBuffer(), figure.size()
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    size = seen.expandedTo(QSize(0, LEAST_HEIGHT))
    if suffix == ".png":
        pixels = max(figure.devicePixelRatioF(), PIXELS)
        image = QImage(size * pixels, QImage.Format.Format_RGB32)
        image.setDevicePixelRatio(pixels)
    else:
        svg = QSvgGenerator(QSvgGenerator.SvgVersion.Svg11)  # the later kind has no clipping
        svg.setOutputDevice(buffer)
        svg.setViewBox(QRect(0, 0, size.width(), size.height()))
        svg.setResolution(figure.logicalDpiX())
        svg.setTitle(figure.accessibleName())
    painter = QPainter(image if suffix == ".png" else svg)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.fillRect(QRect(0, 0, size.width(), size.height()), QColor(theme.PANEL))
    figure.resize(size)
    figure.paint_figure(painter)
    figure.resize(seen)
    painter.end()
    if suffix == ".png":
        image.save(buffer, "PNG")  # type: ignore[call-overload]
    return bytes(buffer.data().data())
