"""A figure's picture as PNG or SVG: as it is shown, in the colours of the theme."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QBuffer, QIODevice, QPoint, QRect
from PySide6.QtGui import QColor, QImage, QPainter
from PySide6.QtSvg import QSvgGenerator

from app.views import theme

LEAST_RATIO = 2.0  # pixels of a PNG to one of the screen's


Figure = Any  # a widget with `figure_size` and `paint_figure`, which paints it without what only the screen needs


def png(figure: Figure) -> bytes:
    ratio = max(figure.devicePixelRatioF(), LEAST_RATIO)
    image = QImage(figure.figure_size() * ratio, QImage.Format.Format_RGB32)
    image.setDevicePixelRatio(ratio)
    image.fill(QColor(theme.PANEL))
    _paint(figure, image)
    buffer = _buffer()
    image.save(buffer, "PNG")  # type: ignore[call-overload]
    return bytes(buffer.data().data())


def svg(figure: Figure) -> bytes:
    buffer = _buffer()
    generator = QSvgGenerator(QSvgGenerator.SvgVersion.Svg11)  # the later kind has no clipping
    generator.setOutputDevice(buffer)
    generator.setSize(figure.figure_size())
    generator.setViewBox(QRect(QPoint(), figure.figure_size()))
    generator.setResolution(figure.logicalDpiX())
    generator.setTitle(figure.accessibleName())
    _paint(figure, generator)
    return bytes(buffer.data().data())


def _buffer() -> QBuffer:
    buffer = QBuffer()
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    return buffer


def _paint(figure: Figure, device: QImage | QSvgGenerator) -> None:
    painter = QPainter(device)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.fillRect(QRect(QPoint(), figure.figure_size()), QColor(theme.PANEL))
    figure.paint_figure(painter)
    painter.end()
