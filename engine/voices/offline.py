"""A voice rendered for a file: sample by sample what a device would be given, as fast as it can be had."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from engine.pluck import Pluck
from engine.presets import PresetInfo
from engine.resonators.base import Array
from engine.resonators.sine_transform import project
from engine.sources import ModelSource, Runaway, SourceState
from engine.values.ear import Ear
from engine.voices.mixer import Mixer
from engine.voices.program import Program
from engine.voices.voice import Voice

SILENCE_S = 0.2  # after the end of one that is rendered until it has decayed
BLOCK_FRAMES = 4096  # between two looks at `advanced`
FIRST_FRAMES, MODEL_FRAMES = 256, 1024  # of a block of a model's frames, at first and later
FILLING = 0.9  # share of the work that these samples are


class OfflineVoice:
    """A voice that is read block by block, without a limiter.

    Args:
        voice: the voice, which never ends by itself.
    """

    def __init__(self, voice: Voice) -> None:
        self.voice = voice
        voice.never_ends()
        self._mixer = Mixer(voice.program.rate_hz, limited=False)
        self._mixer.add(voice)
        self.channels = len(voice.ear.points)

    def read(self, frames: int) -> NDArray[np.float32]:
        """The next frames, (frames, channels), ±1 being full scale.

        Raises:
            Runaway: the output stopped being a string's.
        """
        block = self._mixer.render(frames)
        if self.voice.ran_away:
            raise Runaway(self.voice.seconds)
        return block[:, : self.channels]


class ModelFrames:
    """The frames of a model, block by block from the release on: the same for pictures, ears and files."""

    def __init__(self, source: ModelSource, initial_m: Array) -> None:
        self._source, self._initial_m = source, initial_m  # (grid_points,)
        self._state: SourceState | None = None  # None: before the first block
        self._done = 0  # frames so far

    def advance(self, most: int) -> NDArray[np.float32]:
        """The next frames, `most` at most, (frames, grid_points) in m; the first call gives frame 0 alone.

        Two short blocks let a voice begin soon: the first prepares the model, the second shows its speed.

        Raises:
            Runaway: the output stopped being a string's.
        """
        if self._state is None:
            self._state = self._source.start(self._initial_m[None])
            frames = self._initial_m[None]
        else:
            steps = FIRST_FRAMES if self._done < 2 * FIRST_FRAMES else MODEL_FRAMES
            motion, self._state = self._source.advance(self._state, min(steps, most))
            frames = motion[0]
        self._done += len(frames)
        return frames.astype(np.float32)


def render_voice(
    program: Program,
    source: ModelSource | None,
    info: PresetInfo,
    pluck: Pluck,
    ear: Ear,
    seconds: float,
    advanced: Callable[[float], None] = lambda share: None,
    until_db: float | None = None,
) -> NDArray[np.float32]:
    """The whole of `voice_blocks` at once, (frames, points)."""
    return np.concatenate(list(voice_blocks(program, source, info, pluck, ear, seconds, advanced, until_db)))


def voice_blocks(
    program: Program,
    source: ModelSource | None,
    info: PresetInfo,
    pluck: Pluck,
    ear: Ear,
    seconds: float,
    advanced: Callable[[float], None] = lambda share: None,
    until_db: float | None = None,
) -> Iterator[NDArray[np.float32]]:
    """The first seconds of a pluck in blocks (frames, channels), ±1 being full scale; no limiter.

    A channel is a listening point.

    Args:
        source: what renders the samples of a program that is not compiled.
        seconds: the length at most.
        advanced: receives the share that is done, 0 … 1, now and then; may raise, to end it.
        until_db: ends, with a little silence, where all of the string has fallen so far below its loudest, or where
            the voice is over; None: only after `seconds`.

    Raises:
        Runaway: the output stopped being a string's.
    """
    initial_m = project(pluck.displacement(info.grid_points), info.modes)
    filled_s = seconds + 0.1 if program.rendered else 0.0
    voice = Voice(program, initial_m, ear, 1.0, filled_s, info.rate_hz)
    offline = OfflineVoice(voice)
    if program.rendered:
        assert source is not None
        model, total = ModelFrames(source, initial_m), voice.room
        while voice.room:
            voice.append(voice.sense(model.advance(voice.room)))
            advanced(FILLING * (1 - voice.room / total))
    frames = max(1, round(seconds * program.rate_hz))
    loudest_db = -math.inf
    for first in range(0, frames, BLOCK_FRAMES):
        block = offline.read(min(BLOCK_FRAMES, frames - first))
        yield block
        done = first + len(block)
        advanced(FILLING + (1 - FILLING) * done / frames if program.rendered else done / frames)
        level_db = offline.voice.level_db
        loudest_db = max(loudest_db, level_db)
        if until_db is not None and (level_db < loudest_db - until_db or offline.voice.over):
            rest = min(round(SILENCE_S * program.rate_hz), frames - done)
            yield np.zeros((rest, offline.channels), np.float32)
            return
