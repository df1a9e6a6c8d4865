"""The signal of a source at the listening points, sample by sample: its voice is read, as a file of it would be.

A compiled voice renders itself. Any other is given samples: the model's where that can compute any frame, else those
of the motion, which has every frame.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from app.rendering.subject import Loaded
from app.rendering.take import Pictures, Signal
from engine.kernels.constants import QUANTUM
from engine.kernels.mixer_records import REACH
from engine.levels import FULL_SCALE_M
from engine.pluck import Pluck
from engine.sources import Runaway
from engine.values.ear import Ear
from engine.voices import OfflineVoice, Voice, render_samples

MOTION_FRAMES = 1_024  # of a block of samples of a motion
BEHIND = 4 * QUANTUM  # frames that a voice with given samples reads ahead at most
BEYOND = 2 * REACH + 2 * QUANTUM  # samples after the end, which the differentiator of a velocity reads


class Listening:
    """A reader of the voice of a source into `signal`.

    Args:
        source: its name.
        motion: with every frame of the source, where it cannot be rendered at the listening points alone; else None.
    """

    def __init__(
        self, signal: Signal, loaded: Loaded, source: str, pluck: Pluck, ear: Ear, motion: Pictures | None
    ) -> None:
        self.signal = signal
        self._ear = ear
        voice = loaded.voice(source, pluck, ear, signal.rate_hz, (signal.frames + BEYOND) / signal.rate_hz)
        voice.begin_at_once()
        self._offline = OfflineVoice(voice)
        self._given = 0  # samples of a voice that is not compiled
        self._rest: Iterator[NDArray[np.float32]] | None = None
        if voice.program.rendered and motion is not None:
            self._rest = _motion_samples(voice, motion)
        elif voice.program.rendered:
            self._rest = render_samples(voice, loaded.model, loaded.initial_m(pluck))

    def advance(self, stop: int) -> None:
        """Append to the signal up to a frame, or less where less is there; silence where the source runs away."""
        signal, stop = self.signal, min(stop, self.signal.frames)
        try:
            if self._rest is not None:
                while self._given < stop + BEHIND and len(block := next(self._rest, signal.read(0, 0))):
                    self._given += len(block)
                whole = not self._offline.voice.room
                stop = stop if whole else min(stop, self._given - BEHIND)
            if stop > signal.ready_frames:
                signal.append(self._offline.read(stop - signal.ready_frames) * np.float32(self._ear.full_scale))
        except Runaway:
            signal.end_in_silence()


def _motion_samples(voice: Voice, motion: Pictures) -> Iterator[NDArray[np.float32]]:
    """Give a voice the samples of a motion, block by block; empty ones where no more is ready.

    A point reflection about the last frame continues it.
    """
    weights = (voice.program.grid_weights(voice.ear) / FULL_SCALE_M).astype(np.float32)
    given, last = 0, motion.frames - 1
    while voice.room:
        samples = motion.read(given, given + MOTION_FRAMES) @ weights
        if given > last:
            mirrored = np.maximum(2 * last - np.arange(given, given + voice.room), 0)
            samples = (2 * motion.read(last) - motion.read()[mirrored]) @ weights
        voice.append(samples)
        given += len(samples)
        yield samples
