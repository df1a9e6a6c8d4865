"""Models that are no compiled voice: their samples are rendered ahead of the playhead, by one thread.

A model rings until it is silent, beyond its pictures. One that renders slower than it sounds ends with them, and
begins only when they will be ready in time. Where a voice has no samples it pauses by itself; the others continue.
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
from engine.voices.offline import AHEAD_FIRST, AHEAD_FRAMES

LEAST_S = 0.06  # rendered before it begins
CARE = 0.75  # the part of the measured speed that is counted on, for the load may rise
SILENT = 1e-5  # of full scale
KEPT = 32  # plucks that need not be rendered again
LEAD_S = 2.0  # rendered ahead of the playhead at most, behind the pictures' end
LOOK_S = 0.1  # between two looks at playheads that are so far behind

Known = tuple[SourceState | None, tuple[NDArray[np.float32], ...], float, bool]  # state, blocks, s spent, all of it


@dataclass
class AheadVoice:
    """A voice with the source that renders it.

    Attributes:
        initial_m: (grid_points,).
        weights: (grid_points, channels) of the listening points.
        seconds: the length of the pictures.
        key: what the samples depend on; they are kept by it.
        begin: hands the note over; called once, in any thread, when enough is rendered.
        failed: is called with what went wrong.
        given_up: whether it is not wanted any more.
        from_s: where in its motion it will begin.
        done: the number of frames rendered.
        finished: no more will be rendered.
        begun: it was handed over.
    """

    voice: Voice
    source: ModelSource
    initial_m: NDArray[np.float64]
    weights: NDArray[np.float64]
    seconds: float
    key: tuple[object, ...]
    begin: Callable[[], None]
    failed: Callable[[Exception], None]
    given_up: Callable[[], bool] = lambda: False
    from_s: float = 0.0
    _state: SourceState | None = None
    _frames: list[NDArray[np.float32]] = field(default_factory=list)
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
        timed = self.done - 1 - AHEAD_FIRST
        return timed / self.source.rate_hz / self._spent_s if timed > 0 and self._spent_s > 0 else 0.0

    @property
    def wanted_s(self) -> float:
        """The seconds that must be rendered before it begins."""
        total_s = max(self.from_s, min(self.seconds, (self.done + self.voice.room) / self.source.rate_hz))
        least_s = min(self.from_s + LEAST_S, total_s)
        return max(least_s, total_s - (total_s - self.from_s) * CARE * self.speed) if self.speed else least_s

    @property
    def wants_more(self) -> bool:
        """Return True if it is to be rendered further now."""
        return not self.begun or self.rendered_s < self.seconds or self.lead_s < LEAD_S

    @property
    def waits_s(self) -> float:
        """The seconds until it begins; 0 where it has begun, or the speed is not known yet."""
        if self.begun or not self.speed:
            return 0.0
        return max(0.0, (self.wanted_s - self.rendered_s) / self.speed)

    @property
    def may_begin(self) -> bool:
        return self.finished or (self.speed > 0 and self.rendered_s >= self.wanted_s)

    @property
    def lead_s(self) -> float:
        """The lead of the rendering ahead of playback, in s."""
        return self.rendered_s - (self.voice.seconds if self.begun else -1.0)

    def set_begun(self) -> None:
        """Notes that it is handed over; one that is slower than its sound fades out with its pictures."""
        self.begun = True
        if not self.finished and self.speed * CARE < 1 and self.from_s < self.seconds:
            self.voice.fade_out_by(self.seconds)

    def advance(self) -> None:
        """Render the next block; `finished` after the last one."""
        began_s = time.monotonic()
        if self._state is None:
            self._state = self.source.start(self.initial_m[None])
            block = (self.initial_m @ self.weights)[None]
        else:
            steps = min(AHEAD_FRAMES if self.done > AHEAD_FIRST else AHEAD_FIRST, self.voice.room)
            try:
                frames, self._state = self.source.advance(self._state, steps, self.weights)
                block = frames[0].astype(np.float64)
            except Runaway:
                self._end()
                return
        samples = (block / FULL_SCALE_M).astype(np.float32)
        self._take(samples)
        self._frames.append(samples)
        if self.done > 1 + AHEAD_FIRST:
            self._spent_s += time.monotonic() - began_s
        if self.voice.room == 0 or (self.done > AHEAD_FIRST and float(np.abs(samples).max()) < SILENT):
            self._end()

    @property
    def known(self) -> Known:
        """The part of its pluck that is rendered, and where that can be continued."""
        return self._state, tuple(self._frames), self._spent_s, self.finished

    def take_known(self, known: Known) -> None:
        """Take what is known of the same pluck, and continue from there."""
        self._state, frames, self._spent_s, whole = known
        self._frames = list(frames)
        for samples in frames:
            self._take(samples)
        if whole:
            self._end()

    def _end(self) -> None:
        self.voice.end_here()
        self.finished = True

    def _take(self, samples: NDArray[np.float32]) -> None:
        self.voice.append(samples)
        self.done += len(samples)


class Ahead:
    """The thread, which starts with the first voice; `close` ends it. All may be called from any thread."""

    def __init__(self) -> None:
        self._mailbox = threading.Condition()
        self._voices: list[AheadVoice] = []
        self._known: OrderedDict[tuple[object, ...], Known] = OrderedDict()  # the thread's
        self._closing = False
        self._thread: threading.Thread | None = None

    def render(self, voice: AheadVoice) -> None:
        """Start to render a voice; what is known of the same pluck need not be rendered again."""
        with self._mailbox:
            self._voices.append(voice)
            self._mailbox.notify()
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="render-ahead", daemon=True)
                self._thread.start()

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
                    each for each in self._voices if not each.finished and not each.voice.over and not each.given_up()
                ]
                if not any(each.wants_more for each in self._voices) and not self._closing:
                    self._mailbox.wait(LOOK_S if self._voices else None)
                    continue
                if self._closing:
                    return
                voice = min(self._voices, key=lambda each: each.lead_s)
            try:
                if voice.done == 0 and (known := self._known.get(voice.key)) is not None:
                    voice.take_known(known)
                if not voice.finished:
                    voice.advance()
                self._keep(voice)
                if not voice.begun and voice.may_begin:
                    voice.set_begun()
                    voice.begin()
            except Exception as error:
                voice.finished = True
                voice.failed(error)

    def _keep(self, voice: AheadVoice) -> None:
        self._known[voice.key] = voice.known
        self._known.move_to_end(voice.key)
        while len(self._known) > KEPT:
            self._known.popitem(last=False)
