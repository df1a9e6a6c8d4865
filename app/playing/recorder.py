"""Events as they are played, recorded with their times."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable

from app.player.events import LONGEST_RECORDING, Event, TimedEvent, played_from

FULL = (
    f"The recording is full ({LONGEST_RECORDING} notes, releases and movements of wheels and knobs): what is played "
    "from now on is not in it. End it and save it, then record again."
)


class EventRecorder:
    """A recorder of events, for any thread.

    Args:
        report: is called with a message and its details where a recording is full.

    Attributes:
        ended_s: how long the latest recording lasted.
    """

    def __init__(self, report: Callable[[str, str], None]) -> None:
        self._report = report
        self._lock = threading.Lock()
        self._recorded: list[TimedEvent] | None = None  # None: nothing is being recorded
        self._unfetched: list[TimedEvent] = []  # those that `fetch` has not returned yet
        self._began_s = self.ended_s = 0.0  # by `time.monotonic`, and after that
        self._reported_full = self._counted = False  # counted: times are from the first beat

    @property
    def recording(self) -> bool:
        return self._recorded is not None

    def begin(self, first: Iterable[Event], beat_s: float | None = None) -> None:
        """Record from now on, after the events `first`; an earlier recording is discarded.

        Args:
            beat_s: when the first beat is, as of `time.monotonic`: the recording is counted; see `played_from`.
        """
        with self._lock:
            self._recorded, self._unfetched = [], []
            self._counted, self._reported_full = beat_s is not None, False
            self._began_s = time.monotonic() if beat_s is None else beat_s
        for event in first:
            self.take(event)

    def take(self, event: Event, time_s: float | None = None) -> None:
        """Record an event, played at a time of `time.monotonic`; None: now."""
        with self._lock:
            if self._recorded is None:
                return
            full = len(self._recorded) >= LONGEST_RECORDING
            if not full:
                at_s = time.monotonic() if time_s is None else time_s
                timed_event = TimedEvent(at_s - self._began_s, event)
                self._recorded.append(timed_event)
                self._unfetched.append(timed_event)
            reported_before, self._reported_full = self._reported_full, self._reported_full or full
        if full and not reported_before:
            self._report(FULL, "")

    def cancel(self, event: Event | None = None) -> None:
        """Forget the events whose time is still to come; with `event`, only those equal to it."""
        with self._lock:
            if self._recorded is not None:
                played_s = time.monotonic() - self._began_s
                for part in (self._recorded, self._unfetched):
                    part[:] = [
                        entry
                        for entry in part
                        if entry.time_s <= played_s or (event is not None and entry.event != event)
                    ]

    def end(self) -> list[TimedEvent]:
        """End the recording; return its events as `played_from` has them. `fetch` still returns those up to now."""
        with self._lock:
            recorded, self._recorded = self._recorded or [], None
            self.ended_s = max(0.0, time.monotonic() - self._began_s)
            self._unfetched = [timed_event for timed_event in self._unfetched if timed_event.time_s <= self.ended_s]
        return played_from(recorded, self.ended_s, self._counted)

    def fetch(self) -> list[TimedEvent]:
        """The events whose time has come since the last call, with times in s from the beginning."""
        with self._lock:
            now_s = time.monotonic() - self._began_s
            fetched = [timed_event for timed_event in self._unfetched if timed_event.time_s <= now_s]
            if fetched:
                self._unfetched = [timed_event for timed_event in self._unfetched if timed_event.time_s > now_s]
        return sorted(fetched, key=lambda timed_event: timed_event.time_s)
