"""One pluck in the worker's hands: the motion of its sources, made block by block."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from app.rendering.line import Line
from app.rendering.loaded import Loaded
from app.rendering.request import RenderListener, RenderRequest
from app.rendering.take import SOURCES, Motion, Take
from app.shared.vocabulary import OTHER
from engine.metrics import ErrorSums
from engine.presets import PresetError

Block = NDArray[np.float32]

FIRST_FRAMES = 256  # small, so that a pluck is seen at once
BLOCK_FRAMES = 2048  # each block is twice as long as the last, up to this: another pluck waits for no more


class Job:
    """Renders a request; `advance` does the next block of it.

    Args:
        load: a preset's model and truth.
        helper: another thread, so that two sources are rendered at the same time.
    """

    def __init__(
        self, request: RenderRequest, load: Callable[[Path], Loaded], listener: RenderListener, helper: Executor
    ) -> None:
        self.request = request
        self._load, self._listener, self._helper = load, listener, helper
        self._lines: dict[str, Line] = {}
        self._take: Take | None = None
        self._errors = ErrorSums(0)
        self._finished = False  # and told
        self._begun_s = time.monotonic()

    def ask_again(self, request: RenderRequest) -> None:
        """The same motion, beside other presets."""
        self.request = request

    @property
    def age_s(self) -> float:
        """Since it was asked for."""
        return time.monotonic() - self._begun_s

    @property
    def rendered_s(self) -> float:
        return 0.0 if self._take is None else self._take.ready_frames / self._take.info.rate_hz

    @property
    def idle(self) -> bool:
        """Whether there is nothing left to do."""
        return self._finished and all(name in self._lines and self._lines[name].complete for name in self._wanted())

    def advance(self) -> None:
        """Does a block.

        Raises:
            PresetError: the preset cannot be used.
        """
        begins = self._take is None
        take = self._take = self._take or self._begin()
        self._find_others(take)
        self._advance_motions(take)
        if begins:
            self._listener.take_started(take)
        if take.complete and not self._finished:
            self._finished = True
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

    def _advance_motions(self, take: Take) -> None:
        """Renders a block of both sources, and of others up to there."""
        model, truth = (self._lines[name] for name in SOURCES)
        first = truth.done
        frames = min(min(2 * first, BLOCK_FRAMES) if first else 1 + FIRST_FRAMES, take.frames - first)
        end_s = (first + frames) / truth.rate_hz if first + frames < take.frames else take.seconds + 1.0
        others = {name: self._lines[name] for name in self._wanted()[len(SOURCES) :]}
        behind = {name: min(BLOCK_FRAMES, line.until(end_s)) for name, line in others.items()}
        blocks = self._advance_lines({**dict.fromkeys(SOURCES, frames), **behind})
        for name in others:
            take.others[name].append(blocks[name])
        if frames:
            take.append(blocks["model"], blocks["truth"])
            take.model_ends_s = model.ends_s
            self._measure(first, blocks)

    def _wanted(self) -> list[str]:
        return [*SOURCES, *(OTHER + path.stem for path in self.request.others)]

    def _advance_lines(self, frames: Mapping[str, int]) -> dict[str, Block]:
        """The next frames of each source; the first here, the helper does the others."""
        own, *others = frames
        pending = {name: self._helper.submit(self._lines[name].advance, frames[name]) for name in others}
        return {own: self._lines[own].advance(frames[own])} | {name: each.result() for name, each in pending.items()}

    def _measure(self, first: int, blocks: Mapping[str, Block]) -> None:
        """Adds the error of new frames, the earliest of which is `first`; frame 0 is no prediction."""
        skipped = int(first == 0)
        model, truth = (torch.from_numpy(blocks[name][None, skipped:]) for name in SOURCES)
        self._errors.add(model, truth, first + skipped - 1, row=0)
