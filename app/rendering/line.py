"""A source of a take while it is rendered: its pictures, its flashes and its signal, block by block."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from app.rendering.listening import BEYOND, Listening
from app.rendering.motion import ModelMotion
from app.rendering.strobe import Flashes, Strobe
from app.rendering.subject import Loaded
from app.rendering.take import Pictures, Signal, Take
from engine.resonators.base import Array
from engine.sources import Runaway, SourceState, StringSource
from engine.values.ear import Ear

FIRST_FRAMES = 256  # samples: small, so that a pluck is seen at once
BLOCK_FRAMES = 2048  # pictures; blocks double up to this length, which the next pluck may have to wait for


class SourceLine:
    """The rendering of a source into its motion and its signal.

    Pictures are every `stride`-th sample. Flashes are the moments that slow motion shows, as a strobe does.

    Args:
        name: of the source.
        loaded: its preset; None: a string at rest, in place of a model that cannot be rendered.

    Attributes:
        motion: the pictures.
        stride: samples between two pictures.
        frames: samples in all, the initial displacement first.
        first_frames, block_frames: samples that are rendered at once, at first and later.
        done: samples whose pictures have been rendered.
    """

    def __init__(self, take: Take, name: str, loaded: Loaded | None) -> None:
        self.rate_hz = take.rate_hz if loaded is None else loaded.preset.info.rate_hz
        self.stride = take.stride if loaded is None else loaded.stride
        self.frames = int(take.seconds * self.rate_hz + 1e-6) + 1
        self.first_frames, self.block_frames = 1 + FIRST_FRAMES, BLOCK_FRAMES * self.stride
        self._take = take
        self._name = name
        self._loaded = loaded
        self._source = None if loaded is None else loaded.source(name)
        points = take.info.grid_points
        # the string at its release, (1, grid points) in m
        self._initial = np.zeros((1, points)) if loaded is None else loaded.initial_m(take.pluck)[None]
        self.motion = Pictures(self.rate_hz / self.stride, self._initial.shape[1], take.seconds)
        self._pictures: _Frames | _EveryFrame = _Frames(self._source, self._initial)
        if loaded is not None and name != "truth" and loaded.steps:
            self.motion = loaded.motion(take.pluck, take.seconds)
            self._pictures = _EveryFrame(self.motion)
        self._flashes: Flashes | None = None  # the latest that were requested
        self._shown: _Frames | None = None  # renders flashes that were requested after the pictures
        self._listening: Listening | None = None  # until its signal is complete

    @property
    def done(self) -> int:
        return self._pictures.done

    @property
    def complete(self) -> bool:
        return self.done == self.frames and self._shown is None and self._listening is None

    @property
    def behind(self) -> bool:
        """Return True if flashes that were requested after the pictures are still being rendered."""
        return self._shown is not None

    @property
    def ends_s(self) -> float | None:
        """The time of the last valid frame before the output grew without bound: the string is at rest since.

        None: it did not.
        """
        ends = self._pictures.ends
        return None if ends is None else ends / self.rate_hz

    def show(self, strobe: Strobe) -> None:
        """Begin the flashes of another strobe; they replace the present ones when they have caught up."""
        flashes = self._flashes = Flashes(strobe, self.rate_hz, self.frames, self._initial.shape[1])
        if self.stride > 1 and self.done:
            self._shown = _Frames(self._source, self._initial)
            return
        numbers = flashes.needed(0, self.done)  # the motion has every frame, or none yet
        flashes.take(self.done, numbers, self.motion.read()[numbers])
        self.motion.flashes = flashes

    def listen(self, ear: Ear) -> Signal:
        """Begin a new signal for these listening points, and return it; the present one is not continued."""
        signal = Signal(self.rate_hz, len(ear.points), self._take.seconds)
        if self._source is None or self._loaded is None:
            signal.end_in_silence()
            self._listening = None
        else:
            seconds = (signal.frames + BEYOND) / signal.rate_hz
            voice = self._loaded.voice(self._name, self._take.pluck, ear, signal.rate_hz, seconds)
            self._listening = Listening(signal, voice, self.motion)
        return signal

    def advance(self, samples: int) -> None:
        """Render pictures and flashes of the next samples, flashes that are behind, and a block of the signal."""
        first = self.done
        stop = self.done + samples
        flashes = self._flashes
        if samples:
            numbers = np.arange(-(-first // self.stride) * self.stride, stop, self.stride)
            # the frames of pictures, and of flashes that are rendered along with them
            union, joint = numbers, flashes is not None and self._shown is None
            if flashes is not None and joint:
                union = np.union1d(numbers, flashes.needed(first, stop))
            frames = self._pictures.take(union, stop)
            if flashes is not None and joint:
                flashes.take(stop, union, frames)
            if isinstance(self._pictures, _Frames):
                self.motion.append(frames if len(union) == len(numbers) else frames[np.searchsorted(union, numbers)])
        if self._shown is not None and flashes is not None:
            self._catch_up(self._shown, flashes, max(samples, self.block_frames))
        if self._listening is not None:
            self._listening.advance(min(self.done, self._listening.signal.ready_frames + self.block_frames))
            if self._listening.signal.complete:
                self._listening = None

    def _catch_up(self, frames: _Frames, flashes: Flashes, most: int) -> None:
        """Render flashes that are behind over the next `most` samples; they are shown once they have caught up."""
        stop = min(frames.done + most, self.done)
        numbers = flashes.needed(frames.done, stop)
        flashes.take(stop, numbers, frames.take(numbers, stop))
        if stop == self.done:
            self._shown, self.motion.flashes = None, flashes


class _EveryFrame:
    """The frames of a model that steps through all of them; attributes as of `_Frames`."""

    def __init__(self, motion: ModelMotion) -> None:
        self._motion = motion
        self.done = 0

    @property
    def ends(self) -> int | None:
        return self._motion.ends

    def take(self, numbers: NDArray[np.int64], stop: int) -> NDArray[np.float32]:
        """Frames as of `_Frames`."""
        self._motion.render(stop)
        self.done = stop
        return self._motion.read()[numbers]


class _Frames:
    """The frames of a source, rendered in ascending order; the string is at rest from where it runs away.

    Attributes:
        done: frames that are passed, wanted or not.
        ends: the last frame before the call in which it ran away; None: it has not.
    """

    def __init__(self, source: StringSource | None, initial_m: Array) -> None:
        self._source, self._initial = source, initial_m
        self._state: SourceState | None = None if source is None else source.start(initial_m)
        self.done = 0
        self.ends: int | None = None

    def take(self, numbers: NDArray[np.int64], stop: int) -> NDArray[np.float32]:
        """Frames of these ascending numbers in `done` … stop - 1, (frames, grid_points) in m; passes up to `stop`."""
        out = np.zeros((len(numbers), self._initial.shape[1]), np.float32)
        following = int(len(numbers) > 0 and numbers[0] == 0)  # 1: the first is the release itself
        out[:following] = self._initial
        if self._state is not None and len(numbers) > following:
            assert self._source is not None
            ahead = numbers[following:] - self._state.frame  # frames from the present state
            try:
                frames, self._state = self._source.sample(self._state, ahead, stop - 1 - self._state.frame)
                out[following:] = frames[0]
            except Runaway:  # at rest from here on: such values must never reach a loudspeaker
                self._state, self.ends = None, max(self.done - 1, 0)
        self.done = stop
        return out
