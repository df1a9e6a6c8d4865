"""A drum in motion, where it is struck, and the directions it is heard from."""

from __future__ import annotations

import math

import numpy as np

from app.analysis.moment import caption_of
from app.export.columns import Columns
from app.instruments.drums import PlayedDrum
from app.presets.library import Library
from app.rendering import BlowTake
from app.session.shown import ShownSource
from app.shared.key_names import note_name
from app.shared.vocabulary import DIFFERENCE
from app.stage.session import Session
from app.views.drum.axes import Place
from app.views.drum.ink import HeadFrame
from app.views.drum.view import DrumView
from app.window.panels.base import Moment, StagePanel

HARDEST = 127  # velocity
DRAWN = ("model", "truth", DIFFERENCE)


class DrumPanel(StagePanel):
    """The drum of a key. Places are (x, y) in half-lengths of the drum from its centre."""

    view: DrumView
    of_strings = False
    key = "drum"
    title = "Drum"
    help = (
        "The drum seen from above: the motion of the latest blow in slots A and B, amber up and blue down, in slow "
        "motion. Click on it to strike, with Shift as hard as it goes; drag the green marker to listen from another "
        "side."
    )

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library, DrumView())
        self.view.struck.connect(self._strike)
        self.view.place_moved.connect(lambda x, y: self._aim((x, y)))
        self.view.place_reset.connect(self._reset_place)
        self._key: int | None = None  # MIDI key of the shown drum; None: none is shown yet
        self._shown: PlayedDrum | None = None  # the drum that `_place` is on
        self._place: Place = (0.0, 0.0)  # where it is struck

    @property
    def place(self) -> Place:
        """The place where the keyboard strikes: as chosen, or where the drum was struck last."""
        return self._place

    def choices_changed(self, names: frozenset[str]) -> None:
        if names & {"instrument", "single"} and self._drum is not None and self._key is not None:
            self.show_key(self._key)
        super().choices_changed(names)

    @property
    def _sources(self) -> tuple[ShownSource, ...]:
        """The sources of the slots; of another preset the model plays drums."""
        return tuple(source for source in super()._sources if source.source in DRAWN)

    @property
    def _drum(self) -> PlayedDrum | None:
        drums = self.session.choices.drums
        return None if drums is None or self._key is None else drums.of_key(self._key)

    def show_key(self, key: int, place: Place | None = None) -> None:
        """Show the drum of a MIDI key, with the mark of blows at `place`.

        None: the mark stays on the same drum, and goes to the place of its own on another.
        """
        self._key = key
        drum = self._drum
        if drum is None:
            return
        self.view.set_drum(f"{drum.name}, {note_name(key)}", drum.drum.shape, (drum.drum.length_m, drum.drum.width_m))
        if place is not None or drum != self._shown:
            self._aim(place or drum.place)
        self._shown = drum

    def _frame(self, moment: Moment) -> HeadFrame | None:
        """The displacement of the head now, by source; None: no blow, or one on a drum of another shape."""
        blow, choices = moment.blow, self.session.choices
        if blow is None or not self._looks_like(blow):
            return None
        position_s = min(moment.position_s, blow.ready_s)  # the sound may be ahead of the motions: all at one time
        pictures = {}
        for source in self._sources:
            amplitudes = blow.modal_m(source.source, position_s, choices.speed)
            if amplitudes is not None:
                pictures[source.source] = blow.head.picture(amplitudes)
        return HeadFrame(pictures, caption_of(position_s, choices.speed, blow.horizon_s))

    def _looks_like(self, blow: BlowTake) -> bool:
        """Return True if a blow is on a drum of the shown shape: another pad may just have been struck."""
        if (shown_drum := self._drum) is None:
            return False
        drum, view_drum = blow.modes.drum, shown_drum.drum
        alike = math.isclose(drum.width_m * view_drum.length_m, view_drum.width_m * drum.length_m, rel_tol=1e-6)
        return alike and drum.shape == view_drum.shape

    def columns(self) -> Columns | None:
        """The drum at the shown moment: places in half-lengths from its centre."""
        frame, drum = self.view.frame, self._drum
        if frame is None or drum is None or not frame.pictures_m:
            return None
        rows, columns = next(iter(frame.pictures_m.values())).shape
        edge = drum.drum.width_m / drum.drum.length_m
        y, x = map(np.ravel, np.meshgrid(np.linspace(edge, -edge, rows), np.linspace(-1, 1, columns), indexing="ij"))
        pictures_m = {source: values.ravel() for source, values in frame.pictures_m.items()}
        return Columns({"x (half-lengths)": x, "y (half-lengths)": y, **self.by_heading(pictures_m, "m")})

    # Gestures

    def _strike(self, x: float, y: float, hard: bool) -> None:
        self._aim((x, y))
        self.strike_asked.emit(x, y, HARDEST if hard else self.session.choices.velocity)

    def _aim(self, place: Place) -> None:
        self._place = place
        self.view.set_place(place)

    def _reset_place(self) -> None:
        if (drum := self._drum) is not None:
            self._aim(drum.place)
