"""A panel with a curve of the sound of each source in the slots, the heard one on top, and a legend."""

from __future__ import annotations

from typing import ClassVar

import pyqtgraph as pg

from app.presets.library import Library
from app.session.shown import DEFAULT_SOURCES, LEGEND_FIELDS, ShownSource, part_words, shown_sources
from app.stage.session import Session
from app.views.plots.legend import Legend, set_curves
from app.views.plots.plot import Plot
from app.window.panels.base import Panel


class CurvesPanel(Panel):
    """Curves in `plot`, one for each source that slot A or B holds; drums have them too."""

    of_strings = False
    every = 2
    faint_alpha: ClassVar[int]  # opacity of the curve that is not heard, 0 … 255

    def __init__(self, session: Session, library: Library, plot: Plot) -> None:
        super().__init__(session, library)
        self.plot = self.figure = plot
        self.legend = Legend(plot)
        self._curves: dict[str, pg.PlotDataItem] = {}  # by source
        plot.getPlotItem().showGrid(x=True, y=True, alpha=0.18)
        self.set_sources(DEFAULT_SOURCES)

    def choices_changed(self, names: frozenset[str]) -> None:
        if names & LEGEND_FIELDS:
            self.set_sources(shown_sources(self.session.choices, self.library), part_words(self.session.choices))

    def set_sources(self, sources: tuple[ShownSource, ...], part: str = "") -> None:
        """Set the sources that are drawn; `part` says which part of the sound where it is not all."""
        set_curves(self.plot.getPlotItem(), self._curves, sources, self.faint_alpha)
        self.legend.show_sources(sources, part)
