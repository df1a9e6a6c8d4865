"""One sounding stretch of a track. Every change of the sound is an old voice fading out under a new one."""

from __future__ import annotations

import copy

import numpy as np
from numpy.typing import NDArray

from app.audio.levels import Levels, SmoothGain
from app.audio.track import Track


class Voice:
    """Reads one source of a track onwards from a position, fading in once and fading out at most once.

    Both fades are raised cosines, counted in samples and never in blocks, and they multiply: cutting a
    fade-in short by a fade-out leaves neither a step nor a kink.

    Args:
        track: What is read; the mixer never lets a voice run beyond its ready frames.
        source: One of the track's sources.
        position_frames: The first frame to sound.
        fade_in_frames: Length of the fade-in, 1 or more.
    """

    def __init__(self, track: Track, source: str, position_frames: int, fade_in_frames: int) -> None:
        self.track = track
        self.source = source
        self.position_frames = position_frames
        self._fade_in_frames = fade_in_frames
        self._fade_in_done = 0
        self._fade_out_frames = 0
        self._fade_out_done: int | None = None
        self._gain: SmoothGain | None = None  # at its target when the first samples sound

    def copied(self) -> Voice:
        """The same state again, on the same track."""
        voice = copy.copy(self)
        voice._gain = copy.copy(self._gain)
        return voice

    @property
    def silent(self) -> bool:
        """Whether nothing of it has been heard yet, so that it may be dropped without a fade."""
        return self._fade_in_done == 0

    @property
    def fading_out(self) -> bool:
        return self._fade_out_done is not None

    @property
    def frames_left(self) -> int:
        """How many frames a voice that fades out will still sound."""
        return 0 if self._fade_out_done is None else self._fade_out_frames - self._fade_out_done

    def fade_out(self, frames: int) -> None:
        """Begins the fade-out, shortened to what is ready; a fade-out under way goes on as it is."""
        if self._fade_out_done is None:
            self._fade_out_frames = min(frames, self.track.ready_frames - self.position_frames)
            self._fade_out_done = 0

    def add_to(self, out: NDArray[np.float64], levels: Levels) -> None:
        """Adds the next samples to `out`, shape (frames, channels); while fading out, `frames_left` at most.

        A mono track sounds in every channel; a stereo one needs two.
        """
        frames = len(out) if self._fade_out_done is None else min(len(out), self.frames_left)
        read = self.track.read(self.source, self.position_frames, self.position_frames + frames)
        samples = read.astype(np.float64).reshape(frames, -1)
        gain = levels.gain(self.track, self.source)
        if self._gain is None:
            self._gain = SmoothGain(gain, self.track.rate_hz)
        self._gain.apply(samples, gain)
        rising = min(frames, self._fade_in_frames - self._fade_in_done)
        if rising > 0:
            samples[:rising] *= _rise(self._fade_in_done, rising, self._fade_in_frames)
            self._fade_in_done += rising
        if self._fade_out_done is not None:
            samples *= 1.0 - _rise(self._fade_out_done, frames, self._fade_out_frames)
            self._fade_out_done += frames
        out[:frames] += samples
        self.position_frames += frames


def _rise(start: int, count: int, length: int) -> NDArray[np.float64]:
    """Samples `start` … `start + count` of a raised cosine from 0 to 1 in `length` frames, (count, 1)."""
    return 0.5 - 0.5 * np.cos(np.pi / length * (np.arange(start, start + count)[:, np.newaxis] + 0.5))
