"""Events as they are played, recorded with their times."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable

from app.instrument.events import Event, NoteOn, TimedEvent, releases_for

LONGEST_RECORDING = 100_000  # events
FULL = (
    f"The recording is full ({LONGEST_RECORDING} notes, releases and movements of wheels and knobs): what is played "
    "from now on is not in it. End it and save it, then record again."
)


class EventRecorder:
    """For any thread.

    Args:
        report: is called with a message and its details where a recording is full.
    """

    def __init__(self, report: Callable[[str, str], None]) -> None:
        self._report = report
        self._lock = threading.Lock()
        self._recorded: list[TimedEvent] | None = None
        self._began_s = 0.0
        self._reported_full = False

    @property
    def recording(self) -> bool:
        return self._recorded is not None

    def begin(self, first: Iterable[Event]) -> None:
        """Records from now on, after the events `first`; an earlier recording is discarded."""
        with self._lock:
            self._recorded, self._began_s, self._reported_full = [], time.monotonic(), False
        for event in first:
            self.take(event)

    def take(self, event: Event, time_s: float | None = None) -> None:
        """Records an event, played at a time of `time.monotonic`; None: now."""
        with self._lock:
            if self._recorded is None:
                return
            full = len(self._recorded) >= LONGEST_RECORDING
            if not full:
                at_s = time.monotonic() if time_s is None else time_s
                self._recorded.append(TimedEvent(at_s - self._began_s, event))
            reported, self._reported_full = self._reported_full, self._reported_full or full
        if full and not reported:
            self._report(FULL, "")

    def cancel(self, event: Event | None = None) -> None:
        """Forgets events whose time is still to come, or this one of them."""
        with self._lock:
            if self._recorded is not None:
                played_s = time.monotonic() - self._began_s
                self._recorded = [
                    each
                    for each in self._recorded
                    if each.time_s <= played_s or (event is not None and each.event != event)
                ]

    def end(self) -> list[TimedEvent]:
        """The events, with times in s from the first note on; empty where there was no note.

        Keys and pedals that are down are released at its end.
        """
        with self._lock:
            recorded, self._recorded = self._recorded or [], None
            end_s = time.monotonic() - self._began_s
        events = sorted((each for each in recorded if each.time_s <= end_s), key=lambda each: each.time_s)
        events += [TimedEvent(end_s, event) for event in releases_for(each.event for each in events)]
        first = next((each.time_s for each in events if isinstance(each.event, NoteOn)), None)
        if first is None:
            return []
        return [TimedEvent(max(0.0, each.time_s - first), each.event) for each in events]
