"""Models that are no compiled voice: their samples are rendered ahead of the playhead, by one thread.

A model that renders slower than it sounds begins only when the rest will be ready in time. Where more notes sound
than can be rendered in time, the oldest makes room. A voice without samples pauses by itself; the others continue.
"""

from __future__ import annotations

import math
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
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
SCARCE_S = 0.12  # lead of a note that has sounded for so long, below which the oldest makes room
STOLEN_S = 0.03  # the fade of a note that makes room
CARE = 0.75  # the part of the measured speed that is counted on, for the load may rise
SILENT = 1e-5  # of full scale
KEPT = 32  # plucks whose samples are kept: those of a player who repeats them need not be rendered again


class AheadSamples:
    """The samples of a note's voice, rendered ahead.

    Args:
        motion: of which they are; released with the last of them.
        key: the values that the samples depend on; they are kept under it.
        from_s: where in its motion the note will begin.

    Attributes:
        blocks: of the samples so far, (frames, points) each.
        given: their number so far.
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
        """Root mean square of the first seconds of it."""
        first = np.concatenate(self.blocks)[: round(seconds * self._rate_hz)]
        return math.sqrt(float(np.square(first, dtype=np.float64).mean()))

    def _finish(self) -> None:
        self.voice.end_here()
        self.ready, self._motion = True, None


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
        self._known: OrderedDict[Hashable, NDArray[np.float32]] = OrderedDict()
        self._closing = False
        self._thread: threading.Thread | None = None

    def render(self, note: PluckVoices) -> None:
        """Begin a note once it can, and render the rest of it while it sounds; known samples are there at once."""
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
        if not note.pending and note.seconds > note.from_s + SCARCE_S and _lead_s(note) < SCARCE_S:
            self._make_room()
        if unfinished := note.unfinished:
            samples = min(unfinished, key=lambda samples: samples.rendered_s)
            samples.render()
            if samples.finished:
                self._keep(samples)
        if note.pending and note.ahead and all(samples.ready for samples in note.ahead):
            self._begin(note)

    def _make_room(self) -> None:
        """Release the oldest of the notes that still need samples, unless one is fading out or alone."""
        with self._mailbox:
            sounding = [note for note in self._notes if not note.pending and not note.over]
        if len(sounding) > 1 and not any(note.released for note in sounding):
            sounding[0].release(STOLEN_S)

    def _keep(self, samples: AheadSamples) -> None:
        with self._mailbox:
            self._known[samples.key] = np.concatenate(samples.blocks)
            while len(self._known) > KEPT:
                self._known.popitem(last=False)


def _lead_s(note: PluckVoices) -> float:
    """The lead of the rendering ahead of playback, in s; the note with the least goes first."""
    rendered_s = min((samples.rendered_s for samples in note.unfinished), default=0.0)
    if note.released:
        return rendered_s - note.seconds + SAFE_S
    return rendered_s - (note.seconds if not note.pending else -SAFE_S)
