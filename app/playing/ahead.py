"""Models that are no compiled voice: their samples are rendered ahead of the playhead, by one thread.

A model that renders slower than it sounds begins only when the rest will be ready in time. Where a voice has no
samples it pauses by itself; the others continue.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.rendering.motion import ModelMotion, give
from app.shared.thread_priority import Rank, lower_priority
from engine.voices import Voice
from engine.voices.offline import FIRST_FRAMES

if TYPE_CHECKING:
    from app.playing.note import PluckVoices

LEAST_S = 0.06  # rendered before it begins
SAFE_S = 0.25  # lead of voices that sound, above which one that has not begun goes first
CARE = 0.75  # the part of the measured speed that is counted on, for the load may rise
SILENT = 1e-5  # of full scale


class AheadSamples:
    """The samples of a note's voice, rendered ahead.

    Args:
        motion: of which they are; let go with the last of them.
        from_s: where in its motion the note will begin.

    Attributes:
        given: their number so far.
        finished: there will be no more.
        ready: enough is rendered for the note to begin.
    """

    def __init__(self, voice: Voice, motion: ModelMotion, from_s: float = 0.0) -> None:
        self.voice = voice
        self._motion: ModelMotion | None = motion
        self._rate_hz, self._total_s, self._from_s = motion.rate_hz, motion.frames / motion.rate_hz, from_s
        self._blocks: list[NDArray[np.float32]] = []
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
        """As of the motion, 0 where it is not known."""
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
        self._blocks.append(block)
        self.given += len(block)
        silent = self.given > FIRST_FRAMES and float(np.abs(block).max(initial=0.0)) < SILENT
        self.ready = self.ready or bool(motion.speed and self.rendered_s >= self.wanted_s)
        if silent or not self.voice.room or motion.ends is not None:
            self.voice.end_here()
            self.ready, self._motion = True, None

    def level(self, seconds: float) -> float:
        """Root mean square of the first seconds of it."""
        first = np.concatenate(self._blocks)[: round(seconds * self._rate_hz)]
        return math.sqrt(float(np.square(first, dtype=np.float64).mean()))


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
        self._closing = False
        self._thread: threading.Thread | None = None

    def render(self, note: PluckVoices) -> None:
        """Begin a note once it can, and render the rest of it while it sounds."""
        with self._mailbox:
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
            min(unfinished, key=lambda samples: samples.rendered_s).render()
        if note.pending and note.ahead and all(samples.ready for samples in note.ahead):
            self._begin(note)


def _lead_s(note: PluckVoices) -> float:
    """The lead of the rendering ahead of playback, in s; the note with the least goes first."""
    rendered_s = min((samples.rendered_s for samples in note.unfinished), default=0.0)
    return rendered_s - (note.seconds if not note.pending else -SAFE_S)
