"""The spectrogram at the listening point, computed in a thread of its own as the take grows."""

from __future__ import annotations

import math

from app.analysis.spectrogram import FrequencyRows, Spectrogram
from app.presets.library import Library
from app.rendering import Take
from app.session.choices import Session
from app.session.shown import full_scale_words
from app.views.plots.spectrogram_view import SpectrogramView
from app.window.panels.base import Moment, Panel
from app.window.panels.follower import Follower

EVERY = 3  # moments
ROWS = 320
MOST_COLUMNS = 600  # drawn in one call, so that a panel that is opened late catches up in short steps


class SpectrogramPanel(Panel):
    key = "spectrogram"
    title = "Spectrogram"
    help = (
        "Level over time and frequency of the pick-up's signal at the listening point: model, truth or their "
        "difference, all on one scale."
    )
    view: SpectrogramView

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library)
        self.view = SpectrogramView()
        self.view.plot.seek_asked.connect(self.seek_asked)
        self.view.plot.hovered.connect(self._tell)
        self._follower = Follower("spectrogram", self.told.emit)
        self._spectrogram: Spectrogram | None = None
        self._rows: FrequencyRows | None = None
        self._drawn = 0  # columns
        self._drawn_of: tuple[object, ...] = ()
        self._moments = 0

    def choices_changed(self, names: frozenset[str]) -> None:
        if "pickup" in names:
            self.view.set_full_scale(full_scale_words(self.session.choices))

    def take_started(self, take: Take) -> None:
        self._follower.follow(None)
        self._spectrogram = None  # begun when the panel is visible
        self._drawn_of = ()  # which would hold the last take
        self.view.set_take(take.seconds, take.info.horizon_s, take.info.rate_hz)

    def show_moment(self, moment: Moment) -> None:
        self.view.plot.show_playhead(moment.position_s)
        self._moments += 1
        if moment.take is None or self._moments % EVERY:
            return
        listened = moment.take.listened
        if self._spectrogram is None or self._spectrogram.listened is not listened:
            self._spectrogram = Spectrogram(moment.take, listened)
            self._follower.follow(self._spectrogram)
        self._draw(self._spectrogram)

    def close(self) -> None:
        self._follower.close()

    def _draw(self, spectrogram: Spectrogram) -> None:
        view = self.view
        drawn_of = (spectrogram, view.quantity, view.logarithmic)
        if drawn_of != self._drawn_of:
            if spectrogram.ready == 0:
                return  # the picture before stays until there is something new
            self._drawn_of, self._drawn = drawn_of, 0
            bins = spectrogram.window_frames // 2 + 1
            self._rows = FrequencyRows(bins, spectrogram.bin_hz, ROWS, view.lowest_hz, view.logarithmic)
            view.begin_picture(spectrogram.columns, ROWS, spectrogram.hop_s)
        last = min(spectrogram.ready, self._drawn + MOST_COLUMNS)
        if last > self._drawn:
            assert self._rows is not None
            levels_db = spectrogram.levels_db[view.quantity][self._drawn : last]
            view.show_columns(self._drawn, self._rows.of(levels_db))
            self._drawn = last

    def _tell(self, time_s: float, height: float) -> None:
        wordings, spectrogram = [""], self._spectrogram
        if math.isfinite(time_s) and spectrogram is not None:
            column = round(time_s / spectrogram.hop_s)
            frequency_hz = self.view.frequency_hz(height)
            row = round(frequency_hz / spectrogram.bin_hz)
            levels_db = spectrogram.levels_db[self.view.quantity][: spectrogram.ready]
            if 0 <= column < len(levels_db) and 0 <= row < levels_db.shape[1]:
                level, frequency = f"{levels_db[column, row]:.1f} dB", f"{frequency_hz:.0f} Hz"
                wordings = [f"{time_s:.3f} s   {frequency}   {level}", f"{frequency}   {level}", level]
        self.view.readout.tell(*wordings)
