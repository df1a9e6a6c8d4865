"""A pluck or a blow that the worker renders: the motions and signals of its sources, block by block."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from typing import TYPE_CHECKING

from app.rendering.blow import BlowTake
from app.rendering.line import SourceLine
from app.rendering.note_sound import NoteSound
from app.rendering.strobe import Strobe
from app.rendering.subject import Loaded, Subject, path_of
from app.rendering.take import SOURCES, Listened, Take
from app.shared.vocabulary import OTHER
from engine.presets import PresetError
from engine.values.ear import Ear

if TYPE_CHECKING:
    from app.rendering.drum_line import DrumLine


class RenderJob:
    """The rendering of a request; `advance` does the next block of it, and calls `say` in its thread.

    A line renders one source: "model", "truth", or the model of another preset that is drawn beside them.
    Requests for one motion differ in listening points, slow motion or other presets.

    Args:
        load: returns a preset's model and truth; raises PresetError.
        say: is given a signal's name and its arguments. "started" (the take): a block of it is rendered. "finished"
            (the take): motion, signals and errors are. "other_refused" (name of a preset, message): its model cannot
            be rendered beside this one, and is at rest.
        helper: another thread, so that two sources are rendered at the same time.

    Attributes:
        take: the result, which grows; None before the first block.
    """

    def __init__(
        self,
        request: NoteSound,
        load: Callable[[Subject], Loaded],
        say: Callable[..., None],
        helper: Executor,
    ) -> None:
        self.request = request
        self.take: Take | BlowTake | None = None
        self._load = load
        self._say = say
        self._helper = helper
        self._lines: dict[str, SourceLine | DrumLine] = {}  # by source
        self._strobe: Strobe | None = None  # slow motion that the lines render; None before the first
        self._coming: Listened | None = None  # signals at other listening points, until they are complete
        self._finished = False  # "finished" has been reported
        self._begun_s = time.monotonic()

    def ask_again(self, request: NoteSound) -> None:
        """Take a request for the same motion: see `same_motion` for what may differ."""
        self.request = request

    def announce(self) -> None:
        """Report again what there is: the window may have shown another motion in between."""
        if self.take is not None:
            self._say("started", self.take)
            if self._finished:
                self._say("finished", self.take)

    @property
    def age_s(self) -> float:
        """Seconds since the request."""
        return time.monotonic() - self._begun_s

    @property
    def rendered_s(self) -> float:
        """Seconds of the motion that are rendered."""
        return 0.0 if self.take is None else self.take.ready_frames / self.take.frames_hz

    @property
    def idle(self) -> bool:
        """Return True if there is nothing left to do: all is as the latest request has it."""
        take = self.take
        return (
            take is not None
            and self._finished
            and self._coming is None
            and take.listened.ear == self.request.ear
            and self._strobe == self._wanted_strobe(take)
            and all(name in self._lines and self._lines[name].complete for name in self._source_names())
        )

    def advance(self) -> None:
        """Render a block of each source.

        Raises:
            PresetError: the preset cannot be used.
            ValueError: its model cannot start so.
        """
        begins = self.take is None
        take = self.take = self.take or self._begin()
        if isinstance(take, Take):
            self._find_others(take)
        self._show(take)
        self._listen(take)
        self._advance_lines(take)
        take.measure()
        if begins:
            self._say("started", take)
        if not self._finished and take.complete and take.listened.complete:
            self._finished = True
            self._say("finished", take)

    def _begin(self) -> Take | BlowTake:
        """Begin the take of the request, and the lines of model and truth. Raises as `advance`."""
        request = self.request
        take: Take | BlowTake
        lines: Mapping[str, SourceLine | DrumLine]
        if request.struck is not None:
            from app.rendering.drum_line import begin_blow  # and torch

            take, lines = begin_blow(request, request.struck, self._load(path_of(request.preset)))
        else:
            take, lines = _begin_pluck(request, self._load(request.preset))
        self._lines.update(lines)
        take.listened = self._listened(request.ear)
        return take

    def _find_others(self, take: Take) -> None:
        """Begin the models of other presets that are newly requested."""
        for path in self.request.others:
            name = OTHER + path.stem
            if name in self._lines:
                continue
            try:
                line = SourceLine(take, name, self._load(path))
            except (PresetError, ValueError) as error:
                self._say("other_refused", path.stem, str(error))
                line = SourceLine(take, name, None)
            self._lines[name] = line
            if self._strobe is not None:
                line.show(self._strobe)
            listened = self._coming or take.listened
            listened.signals[name] = line.listen(listened.ear)
            take.motions[name] = line.motion

    def _show(self, take: Take | BlowTake) -> None:
        """Begin new flashes where the slow motion has changed; flashes that are under way are finished first."""
        behind = any(self._lines[name].behind for name in self._source_names() if name in self._lines)
        if self._strobe != (strobe := self._wanted_strobe(take)) and not behind:
            self._strobe = strobe
            for line in self._lines.values():
                line.show(strobe)

    def _listen(self, take: Take | BlowTake) -> None:
        """Begin new signals where the listening points have changed.

        Complete signals stay until the new ones are complete, so that plots follow a point that is dragged as often
        as it can be rendered.
        """
        ear = self.request.ear
        if self._coming is not None and self._is_whole(self._coming):
            take.listened, self._coming = self._coming, None
        if self._coming is None and take.listened.ear != ear:
            if self._is_whole(take.listened):
                self._coming = self._listened(ear)
            elif not take.complete:
                take.listened = self._listened(ear)

    def _listened(self, ear: Ear) -> Listened:
        """New signals of all lines at these listening points, empty so far."""
        return Listened(ear, {name: line.listen(ear) for name, line in self._lines.items()})

    def _is_whole(self, listened: Listened) -> bool:
        """Return True if these signals are complete, those of other presets too."""
        return all(listened.signals[name].complete for name in self._source_names() if name in listened.signals)

    def _wanted_strobe(self, take: Take | BlowTake) -> Strobe:
        return Strobe(self.request.speed, take.fundamental_hz, take.seconds)

    def _advance_lines(self, take: Take | BlowTake) -> None:
        """Render a block of the model here, and in the helper the same of the truth, and the others up to its end.

        Blocks begin short and double. Others that are behind take several calls to catch up.
        """
        model, truth = (self._lines[name] for name in SOURCES)
        first = truth.done  # samples so far
        frames = min(max(truth.first_frames, min(2 * first, truth.block_frames)), truth.frames - first)
        end_s = (first + frames) / truth.rate_hz if first + frames < truth.frames else take.seconds + 1.0
        others = [self._lines[name] for name in self._source_names()[len(SOURCES) :]]
        behind = {line: min(line.block_frames, _samples_until(line, end_s)) for line in others}
        pending = [self._helper.submit(line.advance, count) for line, count in ({truth: frames} | behind).items()]
        model.advance(frames)
        for call in pending:
            call.result()
        take.model_ends_s = model.ends_s

    def _source_names(self) -> list[str]:
        """The sources of the latest request, model and truth first."""
        return [*SOURCES, *(OTHER + path.stem for path in self.request.others)]


def _begin_pluck(request: NoteSound, loaded: Loaded) -> tuple[Take, dict[str, SourceLine]]:
    """A take of a pluck, and the lines of model and truth by source."""
    info, name = loaded.preset.info, loaded.preset.name
    take = Take(name, info, request.pluck, request.seconds, request.ear, loaded.stride, model=loaded.model)
    lines = {name: SourceLine(take, name, loaded) for name in SOURCES}
    take.motions.update({name: line.motion for name, line in lines.items()})
    return take, lines


def _samples_until(line: SourceLine | DrumLine, time_s: float) -> int:
    """The number of samples left to be rendered before a time."""
    return max(0, min(line.frames, math.ceil(time_s * line.rate_hz)) - line.done)
