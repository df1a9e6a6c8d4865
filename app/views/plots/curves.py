"""One curve for each source that is shown, the heard one on top of the others and in full strength."""

from __future__ import annotations

from collections.abc import Sequence

import pyqtgraph as pg

from app.session.shown import ShownSource
from app.views import theme


def set_curves(
    plot: pg.PlotItem, curves: dict[str, pg.PlotDataItem], sources: Sequence[ShownSource], faint_alpha: int
) -> None:
    """Adds curves that `curves` lacks, removes those of other sources, and sets the pen and the order of all."""
    shown = {source.source for source in sources}
    for gone in [name for name in curves if name not in shown]:
        plot.removeItem(curves.pop(gone))
    for source in sources:
        if source.source not in curves:
            curves[source.source] = plot.plot()
        hue = theme.SOURCE_COLOURS[theme.source_kind(source.source)]
        curve = curves[source.source]
        curve.setPen(pg.mkPen(theme.translucent(hue, 255 if source.heard else faint_alpha), width=1))
        curve.setZValue(2 if source.heard else 1)
