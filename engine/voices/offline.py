"""A voice rendered for a file: sample by sample what a device would be given, as fast as it can be had."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from engine.levels import FULL_SCALE_M
from engine.pluck import Pluck
from engine.presets import PresetInfo
from engine.resonators.base import Array
from engine.resonators.sine_transform import project
from engine.sources import ModelSource, Runaway
from engine.values.ear import Ear
from engine.voices.mixer import Mixer
from engine.voices.program import Program
from engine.voices.voice import Voice

SILENCE_S = 0.2  # after the end of one that is rendered until it has decayed
BLOCK_FRAMES = 4096  # between two looks at `advanced`
AHEAD_FIRST, AHEAD_FRAMES = 256, 1024  # of a block of samples that are rendered ahead, at first and later
FILLING = 0.9  # share of the work that these samples are


class OfflineVoice:
    """A voice that is read block by block, without a limiter.

    Args:
        seconds: of one whose samples are rendered: how many of them there will be.
        source_rate_hz: their rate.
    """

    def __init__(
        self,
        program: Program,
        initial_m: Array,
        ear: Ear,
        seconds: float = 0.0,
        source_rate_hz: int = 0,
    ) -> None:
        self.voice = Voice(program, initial_m, ear, 1.0, seconds, source_rate_hz)
        self.voice.never_ends()
        self._mixer = Mixer(program.rate_hz, limited=False)
        self._mixer.add(self.voice)
        self.channels = len(ear.points)

    def read(self, frames: int) -> NDArray[np.float32]:
        """The next frames, (frames, channels), ±1 being full scale.

        Raises:
            Runaway: the output stopped being a string's.
        """
        block = self._mixer.render(frames)
        if self.voice.ran_away:
            raise Runaway(self.voice.seconds)
        return block[:, : self.channels]


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
        advanced: receives the share that is done now and then; may raise, to end it.
        until_db: ends, with a little silence, where all of the string has fallen so far below its start, or where the
            voice is over.

    Raises:
        Runaway: the output stopped being a string's.
    """
    initial_m = project(pluck.displacement(info.grid_points), info.modes)
    filled_s = seconds + 0.1 if program.rendered else 0.0
    offline = OfflineVoice(program, initial_m, ear, filled_s, info.rate_hz)
    if program.rendered:
        assert source is not None
        _fill(offline.voice, source, initial_m, ear, advanced)
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


def ahead_frames(rendered: int) -> int:
    """The frames of the next block of a voice that is rendered ahead, after so many: for ears and files alike.

    Two short ones let it begin soon: the first prepares the model, the second shows its speed.
    """
    return AHEAD_FIRST if rendered < 2 * AHEAD_FIRST else AHEAD_FRAMES


def _fill(voice: Voice, source: ModelSource, initial_m: Array, ear: Ear, advanced: Callable[[float], None]) -> None:
    """Render all samples of a voice beforehand."""
    weights = voice.program.grid_weights(ear)
    state = source.start(initial_m[None])
    voice.append((initial_m @ weights)[None] / FULL_SCALE_M)
    total = voice.room
    while voice.room:
        steps = min(ahead_frames(total - voice.room), voice.room)
        frames, state = source.advance(state, steps, weights)
        voice.append(frames[0].astype(np.float64) / FULL_SCALE_M)
        advanced(FILLING * (1 - voice.room / total))
