"""The motion of a model that steps through every frame: rendered once for all who draw it and hear it.

Where a model has no compiled voice, these frames are its sound too.
"""

from __future__ import annotations

import threading
import time

import numpy as np
from numpy.typing import NDArray

from app.rendering.take import Pictures
from engine.resonators.base import Array
from engine.sources import ModelSource, Runaway
from engine.voices import ModelFrames, Voice
from engine.voices.offline import FIRST_FRAMES


class ModelMotion(Pictures):
    """Pictures of every frame; at rest from where the model runs away. Any thread may render.

    Attributes:
        ends: the last frame before it ran away; None: it has not.
        speed: seconds of motion in a second of rendering, without the first, short block; 0 before there is another.
    """

    def __init__(self, source: ModelSource, initial_m: Array, seconds: float) -> None:
        super().__init__(source.rate_hz, source.grid_points, seconds)
        self._model = ModelFrames(source, initial_m)
        self._lock = threading.Lock()
        self._spent_s = 0.0  # on rendering, without the first block
        self.ends: int | None = None
        self.speed = 0.0

    def render(self, stop: int) -> None:
        """Render up to a frame at least, as far as there are any."""
        stop = min(stop, self.frames)
        while self.ready_frames < stop:
            with self._lock:  # for a block: who hears the motion must not wait for who draws all of it
                if self.ready_frames < stop:
                    self._render_block()

    def _render_block(self) -> None:
        """Append the next block, and measure the speed; zeros up to the end where the model runs away."""
        began_s, left = time.monotonic(), self.frames - self.ready_frames
        try:
            self.append(self._model.advance(left))
        except Runaway:
            self.ends = max(self.ready_frames - 1, 0)
            self.append(np.zeros((left, self.places), np.float32))
            return
        if (frames := self.ready_frames - 1 - FIRST_FRAMES) > 0:
            self._spent_s += time.monotonic() - began_s
            self.speed = frames / self.rate_hz / self._spent_s


def give(voice: Voice, motion: ModelMotion, given: int) -> NDArray[np.float32]:
    """Give a voice the samples of a motion that are ready, and return them, (frames, points).

    Beyond the last frame the motion is continued by its point reflection.

    Args:
        given: how many samples the voice has so far.
    """
    last = motion.frames - 1
    frames = motion.read(given, given + voice.room)
    if given > last:
        mirrored = np.maximum(2 * last - np.arange(given, given + voice.room), 0)
        frames = 2 * motion.read(last) - motion.read()[mirrored]
    samples = voice.sense(frames)
    voice.append(samples)
    return samples
