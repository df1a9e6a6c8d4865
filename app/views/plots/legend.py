"""The sources that are drawn: a curve for each, and the legend; the heard one is in its full colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFontMetrics, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from app.session.shown import DEFAULT_SOURCES, ShownSource
from app.views import theme

STROKE = 16  # pixels: the length of a sample of colour
FAINT_ALPHA = 185  # of 255: of sources that are not heard
HEIGHT = 20  # pixels
SHARE = 0.92  # of the plot's width, at most
_GAP, _BETWEEN = 6, 18  # pixels: from a sample to its text, and from one source to the next


def paint_sources(painter: QPainter, sources: Sequence[ShownSource], x: float, middle: float, right: float) -> float:
    """Paint a row from `x` to `right` at most; cut titles that do not fit. Return the row's end; all in pixels.

    `middle`: the height of the row's middle.
    """
    painter.setFont(theme.small_font(12, bold=True))
    metrics = painter.fontMetrics()
    for source, text in zip(sources, _texts(sources, metrics, right - x), strict=True):
        hue = theme.SOURCE_COLOURS[theme.source_kind(source.source)]
        painter.setPen(QPen(theme.translucent(hue, 255 if source.heard else FAINT_ALPHA), 3))
        painter.drawLine(QPointF(x, middle), QPointF(x + STROKE, middle))
        place = QRectF(x + STROKE + _GAP, middle - HEIGHT / 2, metrics.horizontalAdvance(text) + 1, HEIGHT)
        painter.drawText(place, Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter, text)
        x += STROKE + _GAP + metrics.horizontalAdvance(text) + _BETWEEN
    return x


class Legend(QWidget):
    """A legend over a plot, in its upper right corner; mouse events pass through it."""

    def __init__(self, plot: pg.PlotWidget) -> None:
        super().__init__(plot)
        self._plot = plot
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._sources: tuple[ShownSource, ...] = ()
        self._part = ""  # of the sound that the curves show; "": all of it
        self.show_sources(DEFAULT_SOURCES)
        plot.getPlotItem().vb.sigResized.connect(self._place)

    @property
    def text(self) -> str:
        """The whole text, uncut."""
        return "   ".join([*([self._part] if self._part else []), *map(_caption, self._sources)])

    def show_sources(self, sources: tuple[ShownSource, ...], part: str = "") -> None:
        """Show the sources; `part`: the part of the sound, written before them; "" for all of it."""
        self._sources, self._part = sources, part
        self.setAccessibleName(f"Drawn: {self.text}")
        self._place()
        self.update()

    def _place(self) -> None:
        """Place the legend in the upper right corner of the axes, as wide as its cut texts need."""
        area = self._plot.mapFromScene(self._plot.getPlotItem().vb.sceneBoundingRect()).boundingRect()
        room = int(SHARE * area.width())
        metrics = QFontMetrics(theme.small_font(12, bold=True))
        texts = _texts(self._sources, metrics, room - self._part_width - 2 * _GAP)
        width = self._part_width + _width(texts, metrics) + 2 * _GAP + 1
        self.setGeometry(area.right() - 4 - width, area.top() + 4, width, HEIGHT)

    @property
    def _part_width(self) -> int:
        return QFontMetrics(theme.small_font(12)).horizontalAdvance(self._part) + _BETWEEN if self._part else 0

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(theme.translucent(theme.PANEL, 200))
        painter.drawRoundedRect(QRectF(self.rect()), 4, 4)
        painter.setFont(theme.small_font(12))
        painter.setPen(QColor(theme.FAINT))
        place = QRectF(self.rect()).adjusted(_GAP, 0, 0, 0)
        painter.drawText(place, Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter, self._part)
        paint_sources(painter, self._sources, _GAP + self._part_width, HEIGHT / 2, self.width() - _GAP)


def _caption(source: ShownSource) -> str:
    return f"{source.slots}  {source.title}{source.remark}"


def _texts(sources: Sequence[ShownSource], metrics: QFontMetrics, room: float) -> list[str]:
    """The text of each source, so that all fit in `room` pixels.

    Texts are whole; where these are too wide, without “heard”, which the colour shows; then with cut titles.
    """
    for wording in (sources, [replace(source, heard=False) for source in sources]):
        if _width(texts := [_caption(source) for source in wording], metrics) <= room:
            return texts
    # pixels that are left for titles, shared from the shortest to the longest
    titles = room - _width([_caption(replace(source, title="")) for source in wording], metrics)
    needed = [metrics.horizontalAdvance(source.title) for source in wording]
    for done, place in enumerate(sorted(range(len(needed)), key=lambda i: needed[i])):  # the longest give the most
        needed[place] = int(min(needed[place], max(0.0, titles / (len(needed) - done))))
        titles -= needed[place]
    elide = Qt.TextElideMode.ElideMiddle
    return [
        _caption(replace(source, title=metrics.elidedText(source.title, elide, room)))
        for source, room in zip(wording, needed, strict=True)
    ]


def _width(texts: Sequence[str], metrics: QFontMetrics) -> int:
    """The width of all texts in a row, with their samples of colour, in pixels."""
    return sum(STROKE + _GAP + metrics.horizontalAdvance(text) for text in texts) + _BETWEEN * (len(texts) - 1)


def set_curves(
    plot: pg.PlotItem, curves: dict[str, pg.PlotDataItem], sources: Sequence[ShownSource], faint_alpha: int
) -> None:
    """Add curves that `curves`, by source, lacks, remove those of other sources; set the pen and order of all.

    `faint_alpha`: 0 … 255, of sources that are not heard; the heard one is opaque and in front.
    """
    names = {source.source for source in sources}
    for gone in [name for name in curves if name not in names]:
        plot.removeItem(curves.pop(gone))
    for source in sources:
        if source.source not in curves:
            curves[source.source] = plot.plot()
        hue = theme.SOURCE_COLOURS[theme.source_kind(source.source)]
        curve = curves[source.source]
        curve.setPen(pg.mkPen(theme.translucent(hue, 255 if source.heard else faint_alpha), width=1))
        curve.setZValue(2 if source.heard else 1)
