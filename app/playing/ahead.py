"""The thread that renders models which are no compiled voice, ahead of the playhead.

Where more notes sound than can be rendered in time, the oldest makes room. A voice without samples pauses by itself;
the others continue.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable

import numpy as np
from numpy.typing import NDArray

from app.playing.ahead_samples import AheadSamples
from app.playing.note import PluckVoices
from app.shared.thread_priority import Rank, lower_priority

SAFE_S = 0.25  # a note that sounds with more lead is rendered after one that has not begun
SCARCE_S = 0.12  # where a note that has sounded for longer has less lead, the oldest makes room
STOLEN_S = 0.03  # the fade of a note that makes room
KEPT = 32  # plucks whose samples are kept: those of a player who repeats them need not be rendered again


class Ahead:
    """The thread, which starts with the first note; `close` ends it. All may be called from any thread.

    The lead of a note is how far its samples reach beyond what was played of it, in s.

    Args:
        begin: hands a note over; called in the thread when enough of all its samples is rendered.
        failed: ends a note, and reports what went wrong; called there.
    """

    def __init__(
        self, begin: Callable[[PluckVoices], None], failed: Callable[[PluckVoices, Exception], None]
    ) -> None:
        self._begin, self._failed = begin, failed
        self._mailbox = threading.Condition()
        self._notes: list[PluckVoices] = []  # whose samples are not complete, the oldest first
        # complete samples (frames, points) by `AheadSamples.key`, the latest last
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
        """Render blocks, always of the note with the least lead, until `close`; in the thread."""
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
        """Render a block of the voice of a note that has the fewest samples; begin the note once it can."""
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
        """Keep complete samples for a later note of the same pluck; the oldest beyond KEPT are dropped."""
        with self._mailbox:
            self._known[samples.key] = np.concatenate(samples.blocks)
            while len(self._known) > KEPT:
                self._known.popitem(last=False)


def _lead_s(note: PluckVoices) -> float:
    """The lead of a note in s, to compare notes: one that waits or fades out counts as SAFE_S farther ahead.

    Of one that waits all that is rendered counts. One that needs no more samples counts as rendered to 0: it is
    begun soon, and leaves the list.
    """
    rendered_s = min((samples.rendered_s for samples in note.unfinished), default=0.0)
    if note.released:
        return rendered_s - note.seconds + SAFE_S
    return rendered_s - (note.seconds if not note.pending else -SAFE_S)
