"""The signal of a source at the listening points, sample by sample: its voice is read, as a file of it would be.

A compiled voice renders itself. Any other is given the samples of the motion that is drawn.
"""

from __future__ import annotations

import numpy as np

from app.rendering.motion import ModelMotion, give
from app.rendering.take import Pictures, Signal
from engine.kernels.constants import QUANTUM
from engine.kernels.mixer_records import REACH
from engine.sources import Runaway
from engine.voices import OfflineVoice, Voice

BEHIND = 4 * QUANTUM  # frames that a voice with given samples reads ahead at most
BEYOND = 2 * REACH + 2 * QUANTUM  # samples after the end, which the differentiator of a velocity reads


class Listening:
    """A reader of the voice of a source, which appends to `signal`.

    Args:
        voice: at the rate of the signal, with room for BEYOND frames more.
        motion: that of the source.
    """

    def __init__(self, signal: Signal, voice: Voice, motion: Pictures) -> None:
        self.signal = signal
        voice.begin_at_once()
        self._offline = OfflineVoice(voice)
        self._motion = motion if voice.program.rendered and isinstance(motion, ModelMotion) else None
        self._given = 0  # samples of the motion that the voice has

    def advance(self, stop: int) -> None:
        """Append to the signal up to a frame, or less where less is there; silence where the source runs away."""
        signal, voice, stop = self.signal, self._offline.voice, min(stop, self.signal.frames)
        try:
            if self._motion is not None:
                self._given += len(give(voice, self._motion, self._given))
                if self._motion.complete:
                    self._given += len(give(voice, self._motion, self._given))  # what lies beyond
                else:
                    stop = min(stop, self._given - BEHIND)
            if stop > signal.ready_frames:
                signal.append(self._offline.read(stop - signal.ready_frames) * np.float32(voice.ear.full_scale))
        except Runaway:
            signal.end_in_silence()
