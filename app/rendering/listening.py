"""The signal of a source at the listening points, sample by sample: its voice is read, as a file of it would be.

A compiled voice renders itself. Any other is given samples: the model's where that can compute any frame, else those
of the motion, which has every frame.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.rendering.subject import Loaded
from app.rendering.take import Pictures, Signal
from engine.kernels.constants import QUANTUM
from engine.kernels.mixer_records import REACH
from engine.pluck import Pluck
from engine.resonators.base import Array
from engine.sources import Runaway
from engine.values.ear import Ear
from engine.voices import ModelSamples, OfflineVoice

FIRST_FRAMES = 2_048  # of a compiled voice; blocks double from this length
BLOCK_FRAMES = 32_768  # up to this one
RENDERED_FRAMES = 2_048  # a block of any other voice
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
        self._samples: ModelSamples | None = None
        if voice.program.rendered:
            model = loaded.model if motion is None else _Motion(motion)
            self._samples = ModelSamples(voice, model, loaded.initial_m(pluck))

    def advance(self) -> None:
        """Append a block to the signal, or less where less is available; silence where the source runs away."""
        signal = self.signal
        readable = signal.ready_frames + min(max(FIRST_FRAMES, signal.ready_frames), BLOCK_FRAMES)
        try:
            if self._samples is not None:
                readable = self._render(self._samples)
            count = min(readable, signal.frames) - signal.ready_frames
            if count > 0:
                signal.append(self._offline.read(count) * np.float32(self._ear.full_scale))
        except Runaway:
            signal.end_in_silence()

    def _render(self, samples: ModelSamples) -> int:
        """Give the voice a block of samples; the number of frames up to which it can be read."""
        stop = samples.done + RENDERED_FRAMES
        while samples.voice.room and samples.done < stop and len(samples.advance()):
            pass
        return samples.done - BEHIND if samples.voice.room else self.signal.frames


class _Motion:
    """The source that has the frames of a motion; a point reflection about the last one continues it."""

    def __init__(self, motion: Pictures) -> None:
        self._motion = motion

    def start(self, displacement_m: Array) -> int:
        """The state: the number of the next frame."""
        return 1

    def advance(self, state: int, steps: int, readout: Array) -> tuple[NDArray[np.floating[Any]], int]:
        """The next frames as far as they are ready, (1, frames, points)."""
        motion, last = self._motion, self._motion.frames - 1
        weights = readout.astype(np.float32)
        if state <= last:
            samples = motion.read(state, state + steps) @ weights
        else:
            mirrored = np.maximum(2 * last - np.arange(state, state + steps), 0)
            samples = (2 * motion.read(last) - motion.read()[mirrored]) @ weights
        return samples[None], state + len(samples)
