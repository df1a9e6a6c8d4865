"""One pluck in the worker's hands: its motion and its sound, made block by block.

The sound is read off the motion. Where that is too slow for a pluck that is heard, what is heard is rendered ahead of
it, alone: only the listening points, which cost a fraction. Off stage nothing else is rendered.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from app.audio import Track
from app.audio.strand import START_RESERVE_S
from app.rendering.converter import GUARD_FRAMES
from app.rendering.line import Line
from app.rendering.listening import Listening
from app.rendering.loaded import Loaded
from app.rendering.request import OTHER, RenderListener, RenderRequest
from app.rendering.sound import Read, Sound
from app.rendering.take import SOURCES, Motion, Take
from app.rendering.velocity import REACH_FRAMES
from engine.metrics import ErrorSums
from engine.preset import PresetError

Block = NDArray[np.float32]

FIRST_STEPS = 256  # small, so that a pluck sounds at once; more where that is not enough for it to begin
# Each block is twice as long as the last, up to this. Another pluck waits for no more; but each block is some hundred
# calls, and each of them waits for the interpreter, which the window has most of the time.
BLOCK_FRAMES = 2048
LEAD_S = 0.3  # the motion waits until what is heard is so far ahead
TELL_S = 0.1  # and the window, which then draws all of its views, until it is so far,
TELL_AFTER_S = 0.15  # or so late


class Job:
    """Renders a request; `advance` does the next piece of it.

    Args:
        load: the model and the truth of a preset's file.
        helper: another thread, so that two sources are rendered at the same time.

    Attributes:
        struck: it is to sound to its end, even when it is no longer on stage.
    """

    def __init__(
        self, request: RenderRequest, load: Callable[[Path], Loaded], listener: RenderListener, helper: Executor
    ) -> None:
        self.request = request
        self.struck = request.struck
        self._started_s: float | None = None
        self._load = load
        self._listener = listener
        self._helper = helper
        self._lines: dict[str, Line] = {}  # of the motion
        self._ahead: dict[str, Line] = {}  # of what is heard, where it is further
        self._take: Take | None = None  # while it is on stage
        self._errors = ErrorSums(0)
        self._sound: Sound | None = None
        self._untold: tuple[Track, bool] | None = None  # started, and whether it sounds
        self._on_stage = True
        self._finished = False  # and told

    def ask_again(self, request: RenderRequest) -> None:
        """The same motion is to be heard otherwise: the next `advance` makes its sound anew."""
        self.request, self.struck = request, self.struck or request.struck
        self._sound = None

    def leave_stage(self) -> None:
        """Another pluck takes over: only what sounds is rendered on, read off at the listening points."""
        self._on_stage = False
        self._untold = None
        if self._sound is not None:
            self._sound.let_go()

    def give_up(self) -> None:
        if self._sound is not None:
            self._sound.finish()

    @property
    def idle(self) -> bool:
        """Whether there is nothing left to do, or, off stage, nobody who still plays it."""
        if self._sound is None:
            return not self._on_stage
        if self._on_stage:
            return self._finished and not self._sound.unfinished
        return not self._sound.unfinished or self._sound.track is None

    def ahead_s(self, now_s: float) -> float:
        """How far the rendering is ahead of a playhead that has moved since the start; no job is behind a new one."""
        return -math.inf if self._started_s is None else self._rendered_s - (now_s - self._started_s)

    @property
    def started(self) -> bool:
        """Whether its first block was told."""
        return self._started_s is not None

    @property
    def _rendered_s(self) -> float:
        """Of the sound, or of the motion before there is one."""
        truth = self._lines["truth"]
        return (truth.done if self._sound is None else self._sound.frames_read["truth"]) / truth.rate_hz

    @property
    def _hurried(self) -> bool:
        """Whether it is heard, and hardly further rendered than that."""
        unfinished = self._sound is not None and self._sound.unfinished
        return self.struck and unfinished and self.ahead_s(time.monotonic()) < LEAD_S

    def advance(self) -> None:
        """Does a block.

        Raises:
            PresetError: the preset cannot be used.
        """
        if self._hurried or not self._on_stage:
            self._advance_sound()
        else:
            self._advance_take()
        self._tell_in_time()

    def _advance_take(self) -> None:
        take = self._take = self._take or self._begin()
        self._find_others(take)
        if self._advance_motions(take):
            self._make_sound(take)
            if take.complete and not self._finished:
                self._finished = True
                self._tell()
                self._listener.take_finished(take, self._errors)

    def _begin(self) -> Take:
        pluck, seconds = self.request.pluck, self.request.seconds
        loaded = self._load(self.request.preset)
        info = loaded.preset.info
        self._lines["model"] = Line(loaded.model, info, pluck, seconds)
        self._lines["truth"] = Line(loaded.truth, info, pluck, seconds)
        self._errors = ErrorSums(self._lines["truth"].frames - 1)
        return Take(loaded.preset.name, info, pluck, seconds)

    def _find_others(self, take: Take) -> None:
        """Begins the models of other presets that are asked for now and have not been yet."""
        for path in self.request.others:
            name = OTHER + path.stem
            if name in self._lines:
                continue
            try:
                loaded = self._load(path)
                line = Line(loaded.model, loaded.preset.info, take.pluck, take.seconds)
            except (PresetError, ValueError) as error:
                line = Line(None, take.info, take.pluck, take.seconds)
                self._listener.other_failed(path.stem, str(error))
            self._lines[name] = line
            take.others[name] = Motion(line.rate_hz, line.grid_points, take.seconds)

    def _advance_motions(self, take: Take) -> bool:
        """Renders a block of both sources, and others up to there; whether they have come so far."""
        model, truth = (self._lines[name] for name in SOURCES)
        first = truth.done
        wanted = min(2 * first, BLOCK_FRAMES) if first else _first_frames(truth.rate_hz)
        frames = min(wanted, take.frames - first)
        end_s = (first + frames) / truth.rate_hz if first + frames < take.frames else take.seconds + 1.0
        others = {name: self._lines[name] for name in self._wanted()[len(SOURCES) :]}
        behind = {name: min(BLOCK_FRAMES, line.until(end_s)) for name, line in others.items()}
        blocks = self._advance_lines(self._lines, {**dict.fromkeys(SOURCES, frames), **behind})
        for name in others:
            take.others[name].append(blocks[name])
        if frames:
            take.append(blocks["model"], blocks["truth"])
            take.model_ends_s = model.ends_s
            self._measure(first, blocks)
        return not any(line.until(end_s) for line in others.values())

    def _wanted(self) -> list[str]:
        return [*SOURCES, *(OTHER + path.stem for path in self.request.others)]

    def _advance_lines(
        self, lines: Mapping[str, Line], frames: Mapping[str, int], listening: Listening | None = None
    ) -> dict[str, Block]:
        """The next frames of each source, or what is heard of them; the first here, the helper does the others."""

        def advance(name: str) -> Block:
            line = lines[name]
            return line.advance(frames[name], None if listening is None else listening.weights(line.grid_points))

        own, *others = frames
        pending = {name: self._helper.submit(advance, name) for name in others}
        return {own: advance(own)} | {name: block.result() for name, block in pending.items()}

    def _measure(self, first: int, blocks: Mapping[str, Block]) -> None:
        """Adds the error of new frames, the earliest of which is `first`; frame 0 is no prediction."""
        skipped = int(first == 0)
        model, truth = (torch.from_numpy(blocks[name][None, skipped:]) for name in SOURCES)
        self._errors.add(model, truth, first + skipped - 1, row=0)

    def _make_sound(self, take: Take) -> None:
        """Feeds the track with what is new; one that is made anew is told when it is as long as the motion."""
        sound, anew = self._sound, self._sound is None
        if sound is None:
            rates_hz = {name: self._lines[name].rate_hz for name in self._wanted()}
            sound = Sound(rates_hz, take.seconds, self.request.listening, self.request.sound_rate_hz)
            self._sound = sound
        self._feed_motion(take, sound)
        track = sound.track
        assert track is not None
        if not self.started:
            self._started_s = time.monotonic()
            self._untold = track, self._listener.sound_started(take, track)
        elif anew:
            self._tell()
            self._listener.track_replaced(take, track)

    def _tell_in_time(self) -> None:
        if self._untold is not None and self._started_s is not None:
            now_s, (_, sounds) = time.monotonic(), self._untold
            if not sounds or self.ahead_s(now_s) > TELL_S or now_s - self._started_s > TELL_AFTER_S:
                self._tell()

    def _tell(self) -> None:
        """Once, that it has started."""
        untold, self._untold = self._untold, None
        if untold is not None and self._take is not None:
            self._listener.take_started(self._take, *untold)

    def _feed_motion(self, take: Take, sound: Sound) -> None:
        """What was not heard of the motion yet, if there is any."""
        reads = {}
        for name, done in sound.frames_read.items():
            motion = take.motion(name)
            frames = motion.read(done)
            weights = sound.listening.weights(frames.shape[1]).float().numpy()
            reads[name] = Read(frames @ weights, done + len(frames) == motion.frames)
        sound.feed(reads)

    def _advance_sound(self) -> None:
        """A block of what is heard, ahead of the motion or, off stage, without it."""
        sound = self._sound
        assert sound is not None
        if self._take is not None:
            self._feed_motion(self._take, sound)
        if not self._on_stage:
            self._take = None
        for name, done in sound.frames_read.items():
            if name not in self._ahead or self._ahead[name].done != done:
                self._ahead[name] = copy.copy(self._lines[name])
        truth = self._ahead["truth"]
        end_s = (truth.done + min(2 * truth.done, BLOCK_FRAMES)) / truth.rate_hz
        behind = {name: self._ahead[name].until(end_s) for name in sound.frames_read}
        heard = self._advance_lines(self._ahead, behind, sound.listening)
        sound.feed({name: Read(heard[name], self._ahead[name].complete) for name in heard})


def _first_frames(rate_hz: int) -> int:
    """With the initial displacement; what filters keep back for a while comes on top of what must be ready."""
    return 1 + max(FIRST_STEPS, math.ceil(START_RESERVE_S * rate_hz) + GUARD_FRAMES + REACH_FRAMES)
