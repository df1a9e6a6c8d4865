"""The sound of a take: read off at the listening points, converted to the output's rate block by block."""

from __future__ import annotations

import math
import weakref
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.audio import Track
from app.rendering.converter import PromptConverter
from app.rendering.listening import Listening
from app.rendering.velocity import Differentiator

DIFFERENCE = "difference"
MATCHED_S = 1.0  # so much from the pluck on is compared to match levels
LARGEST_MATCH_DB = 40.0  # beyond this a source is silent rather than soft, and stays as it is


@dataclass(frozen=True)
class Read:
    """What is new of a source: displacement at the listening points (frames, points) in m."""

    signal_m: NDArray[np.floating]
    last: bool


class Sound:
    """A track in the making. `difference` is made of `model` and `truth` on the way.

    Args:
        rates_hz: by source, of the motions; `model` and `truth` are among them.
    """

    def __init__(self, rates_hz: Mapping[str, int], seconds: float, listening: Listening, sound_rate_hz: int) -> None:
        channels = len(listening.points)
        self.listening = listening
        self.frames_read = dict.fromkeys(rates_hz, 0)
        self._lines = {name: _Line(rate_hz, sound_rate_hz, listening) for name, rate_hz in rates_hz.items()}
        length = math.ceil(seconds * sound_rate_hz) + sound_rate_hz // 100
        self._track: Track | None = Track(sound_rate_hz, length, (*rates_hz, DIFFERENCE), channels)
        self._watched = weakref.ref(self._track)
        self._energy = dict.fromkeys(rates_hz, 0.0)
        self._measured = 0

    @property
    def track(self) -> Track | None:
        """None after `let_go`, when nobody else holds it any more."""
        return self._watched()

    @property
    def unfinished(self) -> bool:
        """Whether more can be fed."""
        return not all(line.finished for line in self._lines.values())

    def let_go(self) -> None:
        """From here on the track lives only as long as somebody plays it."""
        self._track = None

    def feed(self, reads: Mapping[str, Read]) -> None:
        """Appends to the track what all sources have by now."""
        track = self.track
        if track is None or track.complete:
            return
        for name, read in reads.items():
            self.frames_read[name] += len(read.signal_m)
            self._lines[name].feed(read)
        room = track.length_frames - track.ready_frames
        frames = min(room, *(len(line.pending) for line in self._lines.values()))
        blocks = {name: line.take(frames) for name, line in self._lines.items()}
        track.append({**blocks, DIFFERENCE: blocks["model"] - blocks["truth"]})
        self._measure(track, blocks, not self.unfinished)
        if not self.unfinished:
            track.finish()

    def finish(self) -> None:
        """Nothing more comes."""
        if (track := self.track) is not None:
            track.finish()

    def _measure(self, track: Track, blocks: Mapping[str, NDArray[np.float32]], finished: bool) -> None:
        """Publishes the gains that match the sources' levels to the truth's, once enough is there."""
        wanted = round(MATCHED_S * track.rate_hz) - self._measured
        if wanted <= 0:
            return
        for name, block in blocks.items():
            self._energy[name] += float(np.square(block[:wanted], dtype=np.float64).sum())
        self._measured += min(wanted, len(blocks["truth"]))
        if self._measured >= round(MATCHED_S * track.rate_hz) or finished:
            self._measured = round(MATCHED_S * track.rate_hz)
            track.set_match_gains({name: self._match_gain(name) for name in blocks})

    def _match_gain(self, name: str) -> float:
        own, truth = self._energy[name], self._energy["truth"]
        limit = 10 ** (LARGEST_MATCH_DB / 20)
        gain = math.sqrt(truth / own) if own > 0 else 0.0
        return gain if 1 / limit <= gain <= limit else 1.0


class _Line:
    """One source on its way to the track."""

    def __init__(self, rate_hz: int, sound_rate_hz: int, listening: Listening) -> None:
        channels = len(listening.points)
        self._full_scale = listening.full_scale
        self._differentiator = Differentiator(rate_hz) if listening.pickup == "velocity" else None
        self._converter = PromptConverter(rate_hz, sound_rate_hz, channels)
        self.pending = np.zeros((0, channels), np.float32)
        self.finished = False

    def feed(self, read: Read) -> None:
        if self.finished or not (len(read.signal_m) or read.last):
            return
        signal: NDArray[np.floating] = read.signal_m
        if self._differentiator is not None:
            signal = self._differentiator.feed(signal, read.last)
        scaled = (signal / self._full_scale).astype(np.float32)
        self.pending = np.concatenate([self.pending, self._converter.feed(scaled, read.last)])
        self.finished = read.last

    def take(self, frames: int) -> NDArray[np.float32]:
        """The next of `pending`, in the shape that a track takes: (frames,) where there is one channel."""
        taken, self.pending = self.pending[:frames], self.pending[frames:]
        return taken[:, 0] if taken.shape[1] == 1 else taken
