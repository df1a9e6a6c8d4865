"""The signal of a source at the listening points, sample by sample, read from its voice.

A compiled voice renders itself; any other is given its samples. They are rendered at the listening points alone where
the model can compute any frame, and read from the motion where that has every frame.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from app.rendering.take import Pictures, Signal
from engine.kernels.constants import QUANTUM
from engine.kernels.mixer_records import REACH
from engine.levels import FULL_SCALE_M
from engine.resonators.base import Array
from engine.sources import Runaway, SourceState, StringSource
from engine.values.ear import Ear
from engine.voices import OfflineVoice, Program

FIRST_FRAMES = 2_048  # of a compiled voice; blocks double from this length
BLOCK_FRAMES = 32_768  # up to this one
RENDERED_FRAMES = 2_048  # a block of any other voice
BEHIND = 4 * QUANTUM  # frames that a voice with given samples reads ahead at most
MIRRORED = 2 * REACH + 2 * QUANTUM  # samples added after the end, which the differentiator of a velocity reads


class Listening:
    """A reader of a source's voice into `signal`.

    Args:
        program: of the voice.
        initial_m: the string at its release, (1, grid_points).
        motion: with every frame of the source, where it cannot be rendered at the listening points alone; else None.
    """

    def __init__(
        self,
        signal: Signal,
        source: StringSource,
        program: Program,
        initial_m: Array,
        ear: Ear,
        motion: Pictures | None,
    ) -> None:
        self.signal = signal
        self._source = source
        self._program = program
        self._initial = initial_m
        self._ear = ear
        self._motion = motion
        seconds = (signal.frames + MIRRORED) / signal.rate_hz if program.rendered else 0.0
        self._offline = OfflineVoice(program, initial_m[0], ear, seconds, signal.rate_hz)
        self._offline.voice.begin_at_once()
        self._weights = program.grid_weights(ear)
        self._given = 0  # samples that the voice was given
        self._last = np.zeros((0, len(ear.points)), np.float32)  # the last of them
        self._state: SourceState | None = None

    def advance(self) -> None:
        """Append a block to the signal, or less where less is available; silence where the source runs away."""
        signal = self.signal
        readable = signal.ready_frames + min(max(FIRST_FRAMES, signal.ready_frames), BLOCK_FRAMES)
        try:
            if self._program.rendered:
                self._give(self._more())
                readable = signal.frames if self._given == signal.frames else self._given - BEHIND
            count = min(readable, signal.frames) - signal.ready_frames
            if count > 0:
                signal.append(self._offline.read(count) * np.float32(self._ear.full_scale))
        except Runaway:
            signal.end_in_silence()

    def _more(self) -> NDArray[np.float32]:
        """The next samples to give to the voice, in m, (frames, points)."""
        stop = min(self._given + RENDERED_FRAMES, self.signal.frames)
        if self._motion is not None:
            return np.asarray(self._motion.read(self._given, stop) @ self._weights.astype(np.float32))
        if self._state is None:
            self._state = self._source.start(self._initial)
            return (self._initial @ self._weights).astype(np.float32)
        if stop == self._given:
            return self._last[:0]
        frames, self._state = self._source.advance(self._state, stop - self._given, self._weights)
        return frames[0].astype(np.float32)

    def _give(self, samples_m: NDArray[np.float32]) -> None:
        voice = self._offline.voice
        if len(samples_m):
            voice.append(samples_m / np.float32(FULL_SCALE_M))
            self._given += len(samples_m)
            self._last = np.concatenate([self._last, samples_m])[-MIRRORED - 1 :]
            if self._given == self.signal.frames:  # a point reflection about its end keeps the signal's slope there
                mirrored = 2 * self._last[-1:] - self._last[-2::-1]
                voice.append(mirrored / np.float32(FULL_SCALE_M))
                voice.end_here()
