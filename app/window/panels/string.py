"""The string in motion, the pluck being drawn, and why a pluck is silent or outside the training range."""

from __future__ import annotations

import math
from dataclasses import replace

from app.analysis.heard import HeardMotion
from app.analysis.moment import Envelope, frame_at
from app.instrument.facts import by_two_numbers, outside_of_string
from app.presets.library import Library
from app.presets.words import judged, shape_word
from app.rendering import BlowTake, Take
from app.rendering.take import Listened
from app.session.choices import Choices, Session, ShownString
from app.session.listener import Listener
from app.session.monitor import Monitor
from app.session.shown import LEGEND_FIELDS, ShownSource, shown_sources
from app.session.silence import why_difference_silent, why_silent
from app.session.slots import info_of
from app.shared.vocabulary import DIFFERENCE
from app.views.string.ground import TrainedPlucks
from app.views.string.ink import ShownPluck
from app.views.string.view import StringView
from app.window.panels.base import Moment, StagePanel
from engine.bounds import WIDTH_RANGE
from engine.pluck import SHAPES, Pluck
from engine.presets import PresetInfo, outside_training

MM = 1000.0
WIDTH_STEP = 1.05  # of a wheel notch
SHAPE_POINTS = 801  # of the pulled shape: the narrowest is round
PLUCK_FIELDS = {"preset", *ShownString.model_fields}
WARNING_FIELDS = {"volume_db", *PLUCK_FIELDS, *Listener.model_fields, *Monitor.model_fields}


class StringPanel(StagePanel):
    key = "string"
    title = "String"
    help = (
        "The string seen from the side: the motion of what slots A and B hold, slowed as by a stroboscope, or the "
        "pluck while it is drawn. Drag on it to pluck; drag the green marker to listen elsewhere. Hatched parts lie "
        "outside the training range."
    )

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library)
        self.view = StringView()
        self._put_on_stage(self.view)
        self.view.pluck_drawn.connect(session.move_pluck)
        self.view.pluck_released.connect(self.pluck_asked)
        self.view.pluck_reset.connect(self._reset_pluck)
        self.view.width_stepped.connect(self._step_width)
        self.view.shape_stepped.connect(self._step_shape)
        self.view.envelope_toggled.connect(lambda on: session.update(envelope=on))
        self._envelope: Envelope | None = None
        self._standing: tuple[object, ...] = ()
        self._shown: tuple[object, ...] = ()
        self._take: Take | None = None  # of this pluck, once it is complete
        self._judged: Listened | None = None  # the signals for which the warning was last set

    def choices_changed(self, names: frozenset[str]) -> None:
        choices = self.session.choices
        if names & PLUCK_FIELDS:
            self._take = None
        if names & WARNING_FIELDS:
            self._show_pluck()
        if names & {"face", *LEGEND_FIELDS}:
            self.view.set_plain(self._plain)
            self.view.set_sources(self._sources)
            self._shown = self._standing = ()
        if "face" in names:
            self.view.set_warning(*self._pluck_warning())
        if names & {"motion", "envelope"}:
            self.view.set_shown(choices.motion, choices.envelope)

    @property
    def _plain(self) -> bool:
        return self.session.choices.face == "play"

    @property
    def _sources(self) -> tuple[ShownSource, ...]:
        """The drawn sources: both slots, or in Play the audible one."""
        sources = shown_sources(self.session.choices, self.library)
        return tuple(source for source in sources if source.heard) if self._plain else sources

    def take_started(self, take: Take | BlowTake) -> None:
        self._envelope = Envelope()
        self._standing = ()

    def take_finished(self, take: Take) -> None:
        self._take = take
        self.view.set_warning(*self._pluck_warning())

    def show_moment(self, moment: Moment) -> None:
        take = moment.take
        position_s = moment.position_s
        choices = self.session.choices
        self._judge()
        standing = moment.standing(choices)
        if not moment.playing and standing == self._standing:
            return
        self._standing = standing
        if take is None or not moment.in_motion(choices):
            self.view.show_frame(None)
            self._shown = ()
            return
        motions = [HeardMotion(take, s.source, s.gain) for s in self._sources]
        rendered = [motion for motion in motions if motion.there]
        # the sound may be ahead of the motions, and one motion ahead of another: all are shown at one time
        position_s = min([position_s, *((motion.ready - 1) / motion.rate_hz for motion in rendered)])
        strobes = [motion.strobes(position_s) for motion in rendered]
        drawn_state = (take, position_s, strobes, choices.speed, choices.envelope, choices.solo)
        if not moment.playing and drawn_state == self._shown:
            return
        self._shown = drawn_state
        envelope = self._envelope if choices.envelope else None
        frame = frame_at(take, motions, position_s, choices.speed, envelope)
        if choices.solo:
            frame = replace(frame, caption=f"all modes, although mode {choices.solo} is soloed   {frame.caption}")
        self.view.show_frame(frame)

    def _judge(self) -> None:
        """Set the warning again once the signals are complete: only then is a silent difference known."""
        take = self._take
        if take is not None and take.listened is not self._judged and take.listened.complete:
            self._judged = take.listened
            self.view.set_warning(*self._pluck_warning())

    def _show_pluck(self) -> None:
        choices = self.session.choices
        entry = self.library.find(self.session.choices.preset)
        view = self.view
        shape_mm = choices.pluck.displacement(SHAPE_POINTS) * MM
        view.set_pluck(ShownPluck(choices.position, choices.amplitude_mm, shape_mm, _label(choices)))
        left, right = choices.listen, choices.listen_right if choices.stereo else None
        view.set_listening_points(*((None, None) if choices.pickup == "bridge" else (left, right)))
        view.set_trained(_trained_plucks(info_of(choices, entry), choices.pluck) if entry else TrainedPlucks())
        view.set_warning(*self._pluck_warning())

    def _pluck_warning(self) -> tuple[str, bool]:
        """The reason why nothing is heard, or what lies outside the training; and True if that is a warning."""
        choices, entry = self.session.choices, self.library.find(self.session.choices.preset)
        silent = why_silent(choices, self.library)
        if not silent and choices.source_heard == DIFFERENCE and self._take is not None:
            silent = why_difference_silent(choices, self._take)
        if silent or self._plain or entry is None:
            return silent, True
        error = math.nan if self._take is None else self._take.error
        patch, string = choices.patch, choices.string
        if patch is None or string is None or not choices.plays_patch:
            return judged("; ".join(outside_training(info_of(choices, entry), choices.pluck)), error)
        drawn_string = by_two_numbers(patch, string)  # as the head of the Lab reports it
        return judged("; ".join(outside_of_string(entry.info, drawn_string, choices.pluck)), error)

    # Gestures

    def _reset_pluck(self) -> None:
        default = Choices()
        self.session.update(position=default.position, amplitude_mm=default.amplitude_mm, width=default.width)
        self.pluck_asked.emit()

    def _step_width(self, notches: float) -> None:
        choices = self.session.choices
        if choices.shape != "triangular":  # it has no width
            width = choices.width * WIDTH_STEP**notches
            self.session.update(width=min(max(width, WIDTH_RANGE[0]), WIDTH_RANGE[1]))

    def _step_shape(self, steps: int) -> None:
        index = SHAPES.index(self.session.choices.shape)
        self.session.update(shape=SHAPES[(index + steps) % len(SHAPES)])


def _label(choices: Choices) -> str:
    words = shape_word(choices.shape)
    return words if choices.shape == "triangular" else f"{words} {choices.width:.3f}"


def _trained_plucks(info: PresetInfo, pluck: Pluck) -> TrainedPlucks:
    return TrainedPlucks(info.trained_range.position, info.trained_amplitudes_mm(pluck))
