"""Plays a MIDI file: its events at their times, from a thread of its own."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence

from app.instrument.events import Event, TimedEvent, channels_in, let_go

LEAD_S = 0.05  # before the first event
JOIN_S = 2.0


class Playback:
    """Plays one list of events at a time.

    Args:
        handle: plays an event; called in the playback's thread.
        ended: is called when the last event was played, or it was stopped; in the playback's thread.
    """

    def __init__(self, handle: Callable[[Event], object], ended: Callable[[], None] = lambda: None) -> None:
        self._handle, self._ended = handle, ended
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def playing(self) -> bool:
        thread = self._thread
        return thread is not None and thread.is_alive()

    def play(self, events: Sequence[TimedEvent]) -> None:
        """Plays these events from their beginning; stops what is being played."""
        self.stop()
        self._stopping = threading.Event()
        work = (sorted(events, key=lambda each: each.time_s), self._stopping)
        self._thread = threading.Thread(target=self._run, args=work, name="midi-playback", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stops, lets every key go and leaves wheels and pedals at rest; may be called again."""
        self._stopping.set()
        thread, self._thread = self._thread, None
        if thread is not None and thread is not threading.current_thread():
            thread.join(JOIN_S)

    def _run(self, events: Sequence[TimedEvent], stopping: threading.Event) -> None:
        began_s = time.monotonic() + LEAD_S
        for each in events:
            if stopping.wait(max(0.0, began_s + each.time_s - time.monotonic())):
                break
            self._handle(each.event)
        for event in let_go(channels_in(each.event for each in events)):
            self._handle(event)
        self._ended()
