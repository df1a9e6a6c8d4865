"""Models that are no compiled voice: their samples are rendered ahead of the playhead, by one thread.

A model that renders slower than it sounds begins only when the rest will be ready in time. Where a voice has no
samples it pauses by itself; the others continue.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from app.shared.thread_priority import Rank, lower_priority
from engine.levels import FULL_SCALE_M
from engine.sources import ModelSource, Runaway, SourceState
from engine.voices import Voice
from engine.voices.offline import AHEAD_FIRST, ahead_frames

LEAST_S = 0.06  # rendered before it begins
SAFE_S = 0.25  # lead of voices that sound, above which one that has not begun goes first
CARE = 0.75  # the part of the measured speed that is counted on, for the load may rise
SILENT = 1e-5  # of full scale
KEPT = 32  # plucks that need not be rendered again


@dataclass
class AheadVoice:
    """A voice with the source that renders it.

    Attributes:
        initial_m: (grid_points,).
        weights: (grid_points, channels) of the listening points.
        key: what the samples depend on; they are kept by it.
        begin: hands the note over; called once, in any thread, when enough is rendered.
        failed: is called with what went wrong.
        given_up: whether it is not wanted any more.
        from_s: where in its motion it will begin.
        ends_s: when the model ran away; None: it did not.
        done: the number of frames rendered.
        frames: their blocks.
    """

    voice: Voice
    source: ModelSource
    initial_m: NDArray[np.float64]
    weights: NDArray[np.float64]
    key: tuple[object, ...]
    begin: Callable[[], None]
    failed: Callable[[Exception], None]
    given_up: Callable[[], bool] = lambda: False
    from_s: float = 0.0
    ends_s: float | None = None
    _state: SourceState | None = None
    frames: list[NDArray[np.float32]] = field(default_factory=list)
    _spent_s: float = 0.0
    done: int = 0
    finished: bool = False
    begun: bool = False

    @property
    def rendered_s(self) -> float:
        return self.done / self.source.rate_hz

    @property
    def speed(self) -> float:
        """Seconds of sound in a second of rendering, without the first, short block; 0 before there is another."""
        frames = self.done - 1 - AHEAD_FIRST
        return frames / self.source.rate_hz / self._spent_s if frames > 0 and self._spent_s > 0 else 0.0

    @property
    def wanted_s(self) -> float:
        """The seconds that must be rendered before it begins."""
        total_s = (self.done + self.voice.room) / self.source.rate_hz
        least_s = min(self.from_s + LEAST_S, total_s)
        return max(least_s, total_s - (total_s - self.from_s) * CARE * self.speed) if self.speed else least_s

    @property
    def waits_s(self) -> float:
        """The seconds until it begins; 0 where it has begun, or the speed is not known yet."""
        if self.begun or not self.speed:
            return 0.0
        return max(0.0, (self.wanted_s - self.rendered_s) / self.speed)

    @property
    def lead_s(self) -> float:
        """The lead of the rendering ahead of playback, in s; the voice with the least is rendered next."""
        return self.rendered_s - (self.voice.seconds if self.begun else -SAFE_S)

    def advance(self) -> None:
        """Render the next block; `finished` after the last one."""
        began_s = time.monotonic()
        if self._state is None:
            self._state = self.source.start(self.initial_m[None])
            block = (self.initial_m @ self.weights)[None]
        else:
            steps = min(ahead_frames(self.done - 1), self.voice.room)
            try:
                frames, self._state = self.source.advance(self._state, steps, self.weights)
                block = frames[0].astype(np.float64)
            except Runaway as error:
                self.ends_s, self.finished = error.time_s, True
                self.voice.end_here()
                return
        samples = (block / FULL_SCALE_M).astype(np.float32)
        done = self.done + len(samples)
        silent = done > AHEAD_FIRST and float(np.abs(samples).max()) < SILENT
        self.take(samples, last=silent or self.voice.room == len(samples))
        if done > 1 + AHEAD_FIRST:
            self._spent_s += time.monotonic() - began_s

    def take(self, samples: NDArray[np.float32], last: bool) -> None:
        """Take samples (frames, channels) that were rendered, or are known from an earlier pluck."""
        self.voice.append(samples)
        self.frames.append(samples)
        self.done += len(samples)
        if last:
            self.voice.end_here()
            self.finished = True


class Ahead:
    """The thread, which starts with the first voice; `close` ends it. All may be called from any thread."""

    def __init__(self) -> None:
        self._mailbox = threading.Condition()
        self._voices: list[AheadVoice] = []
        self._known: OrderedDict[tuple[object, ...], NDArray[np.float32]] = OrderedDict()
        self._closing = False
        self._thread: threading.Thread | None = None

    def render(self, voice: AheadVoice) -> None:
        """Start to render a voice; where the same pluck is known, it begins at once."""
        with self._mailbox:
            kept_samples = self._known.get(voice.key)
            if kept_samples is None:
                self._voices.append(voice)
                self._mailbox.notify()
                if self._thread is None:
                    self._thread = threading.Thread(target=self._run, name="render-ahead", daemon=True)
                    self._thread.start()
                return
        voice.take(kept_samples, last=True)
        voice.begun = True
        voice.begin()

    def close(self) -> None:
        """End the thread, waiting 10 s at most; may be called again."""
        with self._mailbox:
            self._closing = True
            self._mailbox.notify()
        if self._thread is not None:
            self._thread.join(10)

    def _run(self) -> None:
        lower_priority(Rank.RENDERING)
        while True:
            with self._mailbox:
                self._voices = [
                    voice for voice in self._voices if not (voice.finished or voice.voice.over or voice.given_up())
                ]
                self._mailbox.wait_for(lambda: bool(self._voices) or self._closing)
                if self._closing:
                    return
                voice = min(self._voices, key=lambda voice: voice.lead_s)
            try:
                voice.advance()
                if voice.finished and voice.ends_s is None:
                    with self._mailbox:
                        self._known[voice.key] = np.concatenate(voice.frames)
                        while len(self._known) > KEPT:
                            self._known.popitem(last=False)
                if not voice.begun and (voice.finished or (voice.speed and voice.rendered_s >= voice.wanted_s)):
                    voice.begun = True
                    voice.begin()
            except Exception as error:
                voice.finished = True
                voice.failed(error)
