"""The string in motion, the pluck being drawn, and why a pluck is silent or outside the training range."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from app.analysis.heard import HeardMotion
from app.analysis.moment import Envelope, StringFrame, frame_at
from app.export.columns import Columns, aligned
from app.player.facts import by_two_numbers, outside_of_string
from app.presets.library import Library, PresetEntry
from app.presets.words import judged, shape_word
from app.rendering import BlowTake, Take
from app.rendering.take import Listened
from app.session.choices import Choices
from app.session.silence import why_difference_silent
from app.session.slots import info_of
from app.shared.vocabulary import DIFFERENCE
from app.stage.session import Session
from app.views.string.ground import TrainedPlucks
from app.views.string.ink import ShownPluck
from app.views.string.view import StringView
from app.window.panels.base import Moment, StagePanel
from engine.bounds import WIDTH_RANGE
from engine.pluck import SHAPES, Pluck
from engine.presets import outside_training

MM = 1000.0
WIDTH_STEP = 1.05  # factor of the pluck's width for a wheel notch
SHAPE_POINTS = 801  # of the pulled shape: the narrowest is round
PLUCK_FIELDS = {"preset", "string", "pluck"}


class StringPanel(StagePanel):
    """The string and its pluck. Positions are shares of the string's length, 0 … 1; displacements are in mm."""

    view: StringView
    key = "string"
    title = "String"
    help = (
        "The string seen from the side: the motion of what slots A and B hold, slowed as by a stroboscope, or the "
        "pluck while it is drawn. Drag on it to pluck; drag the green marker to listen elsewhere. Hatched parts lie "
        "outside the training range."
    )

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library, StringView())
        self.view.pluck_drawn.connect(session.move_pluck)
        self.view.pluck_released.connect(self.pluck_asked)
        self.view.pluck_reset.connect(self._reset_pluck)
        self.view.width_stepped.connect(self._step_width)
        self.view.shape_stepped.connect(self._step_shape)
        self.view.envelope_toggled.connect(lambda on: session.update(envelope=on))
        self._envelope: Envelope | None = None  # extremes within the last second of the take; None: no take yet
        self._take: Take | None = None  # of this pluck, once all of it is rendered
        self._judged: Listened | None = None  # the signals for which the warning was last set

    def choices_changed(self, names: frozenset[str]) -> None:
        if names & PLUCK_FIELDS:
            self._take = None
            self._show_pluck()
        super().choices_changed(names)

    def take_started(self, take: Take | BlowTake) -> None:
        super().take_started(take)
        self._envelope = Envelope()

    def take_finished(self, take: Take) -> None:
        self._take = take
        self.view.set_warning(*self._warning())

    def show_moment(self, moment: Moment) -> None:
        self._judge()
        super().show_moment(moment)

    def _frame(self, moment: Moment) -> StringFrame | None:
        """The shapes of the string now, by source, in slow motion; None: nothing is rendered."""
        choices, take = self.session.choices, moment.take
        if take is None:
            return None
        motions = [HeardMotion(take.motions, s.source, s.gain) for s in self._sources]
        rendered = [motion for motion in motions if motion.there]
        # the sound may be ahead of the motions, and one motion ahead of another: all are shown at one time
        position_s = min([moment.position_s, *((motion.ready - 1) / motion.rate_hz for motion in rendered)])
        envelope = self._envelope if choices.envelope else None
        frame = frame_at(take, motions, position_s, choices.speed, envelope)
        if choices.solo:
            frame = replace(frame, caption=f"all modes, although mode {choices.solo} is soloed   {frame.caption}")
        return frame

    def _judge(self) -> None:
        """Set the warning again once the signals are complete: only then is a silent difference known."""
        take = self._take
        if take is not None and take.listened is not self._judged and take.listened.complete:
            self._judged = take.listened
            self.view.set_warning(*self._warning())

    def _show_pluck(self) -> None:
        """Draw the chosen pluck, and the range of plucks that its preset was trained on."""
        choices, pluck = self.session.choices, self.session.choices.pluck
        entry = self.library.find(choices.preset)
        shape_mm = pluck.displacement(SHAPE_POINTS) * MM
        self.view.set_pluck(ShownPluck(pluck.position, pluck.amplitude_mm, shape_mm, _label(pluck)))
        trained = TrainedPlucks()
        if entry is not None:
            info = info_of(choices, entry)
            trained = TrainedPlucks(info.trained_range.position, info.trained_amplitudes_mm(pluck))
        self.view.set_trained(trained)

    def _warning(self) -> tuple[str, bool]:
        """The reason why the pluck is silent, or how it lies outside the training; and True if it is a warning.

        "" stands for neither.
        """
        choices, entry = self.session.choices, self.library.find(self.session.choices.preset)
        silent = super()._warning()[0]
        if not silent and choices.source_heard == DIFFERENCE and self._take is not None:
            silent = why_difference_silent(choices, self._take)
        if silent or choices.face == "play" or entry is None:
            return silent, True
        error = math.nan if self._take is None else self._take.error
        return judged(outside_of_shown(choices, entry), error)  # as the head of the Lab reports it

    def columns(self) -> Columns:
        """The string at the shown moment; at rest, the pluck."""
        shapes = {name: (np.linspace(0, 1, len(shape)), shape) for name, shape in self.view.shapes_mm.items()}
        pluck = {"pluck (mm)": shapes[""]} if "" in shapes else {}
        return aligned("position", pluck | self.by_heading(shapes, "mm"))

    # Gestures

    def _reset_pluck(self) -> None:
        self.session.update(pluck=Pluck(shape=self.session.choices.pluck.shape))
        self.pluck_asked.emit()

    def _step_width(self, notches: float) -> None:
        pluck = self.session.choices.pluck
        if pluck.shape != "triangular":  # it has no width
            width = pluck.width * WIDTH_STEP**notches
            self.session.update(width=min(max(width, WIDTH_RANGE[0]), WIDTH_RANGE[1]))

    def _step_shape(self, steps: int) -> None:
        index = SHAPES.index(self.session.choices.pluck.shape)
        self.session.update(shape=SHAPES[(index + steps) % len(SHAPES)])


def outside_of_shown(choices: Choices, entry: PresetEntry) -> str:
    """The differences of the shown string and its pluck from the training of its preset, in words; "": none."""
    string, instrument = choices.string, choices.instrument
    if string is None:
        return "; ".join(outside_training(entry.info, choices.pluck))
    if instrument is not None and choices.plays_instrument:
        string = by_two_numbers(instrument, string)
    return "; ".join(outside_of_string(entry.info, string, choices.pluck))


def _label(pluck: Pluck) -> str:
    words = shape_word(pluck.shape)
    return words if pluck.shape == "triangular" else f"{words} {pluck.width:.3f}"
