"""Models that are no compiled voice: their samples are rendered ahead of the playhead, by one thread.

A model that renders slower than it sounds begins only when the rest will be ready in time. Where a voice has no
samples it pauses by itself; the others continue.
"""

from __future__ import annotations

import math
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.shared.thread_priority import Rank, lower_priority
from engine.resonators.base import Array
from engine.sources import ModelSource, Runaway
from engine.voices import Voice, render_samples
from engine.voices.offline import AHEAD_FIRST

if TYPE_CHECKING:
    from app.playing.note import PluckVoices

LEAST_S = 0.06  # rendered before it begins
SAFE_S = 0.25  # lead of voices that sound, above which one that has not begun goes first
CARE = 0.75  # the part of the measured speed that is counted on, for the load may rise
SILENT = 1e-5  # of full scale
KEPT = 32  # plucks that need not be rendered again


class AheadSamples:
    """The samples of a note's voice, rendered ahead.

    Args:
        key: what the samples depend on; they are kept by it.
        from_s: where in its motion the note will begin.

    Attributes:
        blocks: of the samples so far; done: their number.
        ready: enough is rendered for the note to begin.
        ran_away: the model did; its voice ends before.
    """

    def __init__(
        self, voice: Voice, source: ModelSource, initial_m: Array, key: tuple[object, ...], from_s: float = 0.0
    ) -> None:
        self.voice, self.key = voice, key
        self._from_s, self._rate_hz = from_s, source.rate_hz
        self._rest = render_samples(voice, source, initial_m)
        self.blocks: list[NDArray[np.float32]] = []
        self.done = 0
        self.finished = self.ready = self.ran_away = False
        self._spent_s = 0.0

    @property
    def rendered_s(self) -> float:
        return self.done / self._rate_hz

    @property
    def speed(self) -> float:
        """Seconds of sound in a second of rendering, without the first, short block; 0 before there is another."""
        frames = self.done - 1 - AHEAD_FIRST
        return frames / self._rate_hz / self._spent_s if frames > 0 and self._spent_s > 0 else 0.0

    @property
    def wanted_s(self) -> float:
        """The seconds that must be rendered before it begins."""
        total_s = (self.done + self.voice.room) / self._rate_hz
        least_s = min(self._from_s + LEAST_S, total_s)
        return max(least_s, total_s - (total_s - self._from_s) * CARE * self.speed) if self.speed else least_s

    @property
    def waits_s(self) -> float:
        """The seconds until it is ready; 0 where it is, or the speed is not known yet."""
        if self.ready or not self.speed:
            return 0.0
        return max(0.0, (self.wanted_s - self.rendered_s) / self.speed)

    def render(self) -> None:
        """Render the next block; `finished` after the last one."""
        began_s = time.monotonic()
        try:
            block = next(self._rest)
        except Runaway:
            self.finished = self.ready = self.ran_away = True
            return
        self.blocks.append(block)
        self.done += len(block)
        if not self.voice.room or (self.done > AHEAD_FIRST and float(np.abs(block).max()) < SILENT):
            self._finish()
        if self.done > 1 + AHEAD_FIRST:
            self._spent_s += time.monotonic() - began_s
        self.ready = self.ready or bool(self.speed and self.rendered_s >= self.wanted_s)

    def take(self, samples: NDArray[np.float32]) -> None:
        """Take all samples, (frames, channels), which are known from an earlier pluck."""
        self.voice.append(samples)
        self.blocks, self.done = [samples], len(samples)
        self._finish()

    def level(self, seconds: float) -> float:
        """Root mean square of the first seconds of it."""
        first = np.concatenate(self.blocks)[: round(seconds * self._rate_hz)]
        return math.sqrt(float(np.square(first, dtype=np.float64).mean()))

    def _finish(self) -> None:
        self.voice.end_here()
        self.finished = self.ready = True


class Ahead:
    """The thread, which starts with the first note; `close` ends it. All may be called from any thread.

    Args:
        begin: hands a note over; called in the thread when enough of all its samples is rendered.
        failed: ends a note, and reports what went wrong; called there.
    """

    def __init__(
        self, begin: Callable[[PluckVoices], None], failed: Callable[[PluckVoices, Exception], None]
    ) -> None:
        self._begin, self._failed = begin, failed
        self._mailbox = threading.Condition()
        self._notes: list[PluckVoices] = []
        self._known: OrderedDict[tuple[object, ...], NDArray[np.float32]] = OrderedDict()
        self._closing = False
        self._thread: threading.Thread | None = None

    def render(self, note: PluckVoices) -> None:
        """Begin a note, and render the rest of it while it sounds; the samples of a pluck that is known are there."""
        with self._mailbox:
            for samples in note.ahead:
                if (known := self._known.get(samples.key)) is not None:
                    samples.take(known)
            self._notes.append(note)
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
                self._mailbox.wait_for(lambda: bool(self._notes) or self._closing)
                if self._closing:
                    return
                note = min(self._notes, key=_lead_s)
            try:
                self._advance(note)
            except Exception as error:
                self._failed(note, error)
            with self._mailbox:
                if note.over or not note.unfinished:
                    self._notes.remove(note)

    def _advance(self, note: PluckVoices) -> None:
        """Render a block of a note's samples, those of which there are fewest; begin the note once it can."""
        if unfinished := note.unfinished:
            samples = min(unfinished, key=lambda samples: samples.rendered_s)
            samples.render()
            if samples.finished and not samples.ran_away:
                with self._mailbox:
                    self._known[samples.key] = np.concatenate(samples.blocks)
                    while len(self._known) > KEPT:
                        self._known.popitem(last=False)
        if note.pending and note.ahead and all(samples.ready for samples in note.ahead):
            self._begin(note)


def _lead_s(note: PluckVoices) -> float:
    """The lead of the rendering ahead of playback, in s; the note with the least goes first."""
    rendered_s = min((samples.rendered_s for samples in note.unfinished), default=0.0)
    return rendered_s - (note.seconds if not note.pending else -SAFE_S)
