"""The ground behind the string: grid, scale, and hatching outside the training range."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from PySide6.QtCore import QLineF, QRectF, Qt
from PySide6.QtGui import QBrush, QFontMetrics, QPainter

from app.views import theme
from app.views.painting import set_ink, write
from app.views.stage import MARGIN_X
from app.views.string.axes import StringAxes

LINE_HEIGHT = 15
HATCHING = 70  # alpha, 0 … 255
SCALES = ((-1, -0.5, 0, 0.5, 1), (-1, 0, 1), (0,))  # shares of the span, for less and less height
SCALE_LINE = 13  # pixels between two figures of the scale, at least


@dataclass(frozen=True)
class TrainedPlucks:
    """The positions and amplitudes that the model was trained on, (lowest, highest); None: all."""

    position: tuple[float, float] | None = None
    amplitude_mm: tuple[float, float] | None = None


def paint_ground(painter: QPainter, axes: StringAxes, trained: TrainedPlucks | None, pluck: int | None) -> None:
    """Paint the grid, the scale and the hatching; nothing where `trained` is None.

    `pluck`: the end of the string, 0 or 1, that the pluck is nearer to; None while the motion is shown. Only for a
    pluck are amplitudes hatched, which a string in motion all crosses, and words written, which it would cover.
    """
    if trained is None:
        return
    paint_grid(painter, axes)
    _paint_scale(painter, axes)
    if trained.position is not None:
        _paint_untrained_positions(painter, axes, trained.position, words=pluck is not None)
    if pluck is not None and trained.amplitude_mm is not None:
        _paint_untrained_amplitudes(painter, axes, trained, pluck)


def paint_grid(painter: QPainter, axes: StringAxes) -> None:
    """Tenths of the string and the scale's lines."""
    set_ink(painter, theme.translucent(theme.LINE, 120))
    painter.drawLines(_grid(axes))


def scale(axes: StringAxes) -> tuple[float, ...]:
    """The displacements that have a line and a figure, as shares of the span: as many as the height has room for."""
    return next(marks for marks in SCALES if 2 * axes.half_height >= SCALE_LINE * (len(marks) - 1))


@lru_cache(maxsize=2)
def _grid(axes: StringAxes) -> list[QLineF]:
    xs = [round(axes.x(tenth / 10)) + 0.5 for tenth in range(11)]
    ys = [round(axes.middle - share * axes.half_height) + 0.5 for share in scale(axes)]
    return [QLineF(x, axes.top, x, axes.bottom) for x in xs] + [QLineF(axes.x(0), y, axes.x(1), y) for y in ys]


def _paint_scale(painter: QPainter, axes: StringAxes) -> None:
    align = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
    for share in scale(axes):
        place = QRectF(0, axes.middle - share * axes.half_height - 8, MARGIN_X - 8, 16)
        words = f"{share * axes.span_mm:+g}" if share else "0 mm"
        write(painter, place, words, theme.FAINT, theme.small_font(10), align)


def _shade(painter: QPainter, area: QRectF) -> None:
    """Darken and hatch an area, in pixels."""
    set_ink(painter, fill=theme.SHADE)
    painter.drawRect(area)
    painter.setBrush(QBrush(theme.translucent(theme.FAINT, HATCHING), Qt.BrushStyle.BDiagPattern))
    painter.drawRect(area)


def _paint_untrained_positions(
    painter: QPainter, axes: StringAxes, trained: tuple[float, float], words: bool
) -> None:
    """Hatch both ends of the string, outside the trained positions (lowest, highest); `words`: say so there."""
    low, high = trained
    height = axes.bottom - axes.top
    font = theme.small_font(11)
    lines = ("not trained here", f"only plucks at {low:g} … {high:g}") if words else ()
    for start, stop in ((0.0, low), (high, 1.0)):
        if stop <= start:
            continue
        area = QRectF(axes.x(start), axes.top, axes.x(stop) - axes.x(start), height)
        _shade(painter, area)
        for row, text in enumerate(lines):
            line = area.adjusted(4, 0, -4, -8 - theme.px(LINE_HEIGHT) * (1 - row))
            if QFontMetrics(font).horizontalAdvance(text) > line.width() or line.height() < theme.px(LINE_HEIGHT):
                continue  # the hatching says it
            colour = theme.translucent(theme.TEXT if row == 0 else theme.FAINT, 190)
            write(painter, line, text, colour, font, Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignBottom)


def _paint_untrained_amplitudes(painter: QPainter, axes: StringAxes, trained: TrainedPlucks, pluck: int) -> None:
    """Hatch amplitudes below and above the trained ones, with words at the end of the string that `pluck` is not at.

    `pluck`: the end that the pluck is nearer to: 0, left, or 1.
    """
    assert trained.amplitude_mm is not None
    low_mm, high_mm = trained.amplitude_mm
    left, right = trained.position or (0.0, 1.0)  # beside them it is shaded already
    free = Qt.AlignmentFlag.AlignLeft if pluck else Qt.AlignmentFlag.AlignRight
    for bottom_mm, top_mm, text in (
        (0.0, min(low_mm, axes.span_mm), f"not trained below {low_mm:.3g} mm"),
        (high_mm, axes.span_mm, f"not trained above {high_mm:.3g} mm"),
    ):
        if top_mm <= bottom_mm:
            continue
        area = QRectF(axes.at(left, top_mm), axes.at(right, bottom_mm))
        _shade(painter, area)
        if area.height() >= theme.px(LINE_HEIGHT):
            line, align = area.adjusted(8, 0, -8, 0), free | Qt.AlignmentFlag.AlignVCenter
            write(painter, line, text, theme.translucent(theme.TEXT, 190), theme.small_font(11), align)
