"""The samples of a voice whose model is not compiled, rendered ahead of the playhead.

A model that renders slower than it sounds begins only when the rest will be ready in time.
"""

from __future__ import annotations

import math
from collections.abc import Hashable

import numpy as np
from numpy.typing import NDArray

from app.rendering.motion import ModelMotion, give
from engine.voices import Voice
from engine.voices.offline import FIRST_FRAMES

LEAST_S = 0.06  # rendered before it begins
CARE = 0.75  # the part of the measured speed that is counted on, for the load may rise
SILENT = 1e-5  # of full scale


class AheadSamples:
    """The samples of a note's voice, rendered ahead.

    Args:
        motion: the model's, which the voice senses at its listening points; released with the last samples.
        key: the values that the samples depend on; they are kept under it.
        from_s: where in its motion the note will begin.

    Attributes:
        blocks: of the samples so far, (frames, points) each.
        given: frames so far.
        finished: there will be no more.
        ready: enough is rendered for the note to begin.
    """

    def __init__(self, voice: Voice, motion: ModelMotion, key: Hashable, from_s: float = 0.0) -> None:
        self.voice, self.key = voice, key
        self._motion: ModelMotion | None = motion
        self._rate_hz, self._total_s, self._from_s = motion.rate_hz, motion.frames / motion.rate_hz, from_s
        self.blocks: list[NDArray[np.float32]] = []
        self.given = 0
        self.ready = False

    @property
    def finished(self) -> bool:
        return self._motion is None

    @property
    def rendered_s(self) -> float:
        return self.given / self._rate_hz

    @property
    def _speed(self) -> float:
        """The speed of the motion, 0 where it is not known."""
        return 0.0 if self._motion is None else self._motion.speed

    @property
    def wanted_s(self) -> float:
        """The seconds that must be rendered before it begins."""
        least_s = min(self._from_s + LEAST_S, self._total_s)
        return max(least_s, self._total_s - (self._total_s - self._from_s) * CARE * self._speed)

    @property
    def waits_s(self) -> float:
        """The seconds until it is ready; 0 where it is, or the speed is not known yet."""
        speed = self._speed
        return 0.0 if self.ready or not speed else max(0.0, (self.wanted_s - self.rendered_s) / speed)

    def render(self) -> None:
        """Render the next block; `finished` after the last one."""
        if (motion := self._motion) is None:
            return
        motion.render(self.given + 1)
        block = give(self.voice, motion, self.given)
        self.blocks.append(block)
        self.given += len(block)
        silent = self.given > FIRST_FRAMES and float(np.abs(block).max(initial=0.0)) < SILENT
        self.ready = self.ready or bool(motion.speed and self.rendered_s >= self.wanted_s)
        if silent or not self.voice.room or motion.ends is not None:
            self._finish()

    def take(self, samples: NDArray[np.float32]) -> None:
        """Take all samples, (frames, points), which are known from an earlier pluck."""
        self.voice.append(samples)
        self.blocks, self.given = [samples], len(samples)
        self._finish()

    def level(self, seconds: float) -> float:
        """Root mean square of the samples of the first `seconds`, of full scale."""
        first = np.concatenate(self.blocks)[: round(seconds * self._rate_hz)]
        return math.sqrt(float(np.square(first, dtype=np.float64).mean()))

    def _finish(self) -> None:
        self.voice.end_here()
        self.ready, self._motion = True, None
