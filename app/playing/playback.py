"""Playback of a MIDI file. A thread hands each event over before its time, with the frame at which it counts."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from app.audio.sound import Sound
from app.player.events import Event, TimedEvent, channels_in, release_all
from engine.voices import Mixer

AHEAD_S = 0.05  # lead of a handed-over event, besides the device's buffer: so late the thread may be
LOOK_S = 0.05  # between two looks at the mixer, at most: it may be another
JOIN_S = 2.0  # for the end of the thread, at most


@dataclass(frozen=True)
class Due:
    """The time of an event that is handed over before it: a frame of a mixer.

    Where another mixer has taken its place, the event counts at once.

    Attributes:
        time_s: the same on the clock of `time.monotonic`, in s.
    """

    mixer: Mixer
    frame: int
    time_s: float

    def frame_in(self, mixer: Mixer) -> int:
        """The frame of this mixer; 0, at once, where it is another."""
        return self.frame if mixer is self.mixer else 0


class Playback:
    """A player of one list of events at a time.

    Args:
        sound: whose mixer has the frames that a device has taken.
        handle: plays an event when it is due, or, for None, at once; called in the playback's thread.
        cancel: ends what was handed over and is not due yet; called there as well.
        ended: is called when the last event was played, or it was stopped; in the playback's thread.
    """

    def __init__(
        self,
        handle: Callable[[Event, Due | None], object],
        sound: Sound,
        cancel: Callable[[], None],
        ended: Callable[[], None] = lambda: None,
    ) -> None:
        self._handle = handle
        self._sound = sound
        self._cancel = cancel
        self._ended = ended
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def playing(self) -> bool:
        thread = self._thread
        return thread is not None and thread.is_alive()

    def play(self, events: Sequence[TimedEvent]) -> None:
        """Play these events from their beginning; stop what is being played."""
        self.stop()
        self._stopping = threading.Event()
        work = (sorted(events, key=lambda timed_event: timed_event.time_s), self._stopping)
        self._thread = threading.Thread(target=self._run, args=work, name="midi-playback", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop, let every key go and leave wheels and pedals at rest; may be called again."""
        self._stopping.set()
        thread, self._thread = self._thread, None
        if thread is not None and thread is not threading.current_thread():
            thread.join(JOIN_S)

    def _run(self, events: Sequence[TimedEvent], stopping: threading.Event) -> None:
        """Hand over each event ahead of its time; release keys and wheels after the last one, or when stopped."""
        beginning, due = Beginning(self._sound, self._ahead_s), None
        nobody_plays = release_all(channels_in(timed_event.event for timed_event in events))
        for timed_event in events:
            due = beginning.wait(timed_event.time_s, self._ahead_s, stopping)
            if stopping.is_set():
                break
            self._handle(timed_event.event, due)
        else:
            for event in nobody_plays:  # with the last event
                self._handle(event, due)
            if events:
                beginning.wait(events[-1].time_s, 0.0, stopping)
        if stopping.is_set():
            self._cancel()
            for event in nobody_plays:
                self._handle(event, None)
        self._ended()

    @property
    def _ahead_s(self) -> float:
        return AHEAD_S + self._sound.buffer_s


class Beginning:
    """The frame at which a list of events begins, `ahead_s` from now; in another mixer it continues."""

    def __init__(self, sound: Sound, ahead_s: float) -> None:
        self._sound, self._mixer = sound, sound.mixer
        self._frame = self._mixer.frames + round(ahead_s * self._mixer.rate_hz)  # of `_mixer`, at time 0 of the list
        self._began_s = time.monotonic() + ahead_s  # the same, on the clock of `time.monotonic`

    def due(self, time_s: float) -> Due:
        """The time when an event is due, `time_s` after the beginning."""
        mixer = self._sound.mixer
        if mixer is not self._mixer:
            played_s = (self._mixer.frames - self._frame) / self._mixer.rate_hz
            self._mixer, self._frame = mixer, mixer.frames - round(played_s * mixer.rate_hz)
            self._began_s = time.monotonic() - played_s
        return Due(mixer, self._frame + round(time_s * mixer.rate_hz), self._began_s + time_s)

    def wait(self, time_s: float, ahead_s: float, stopping: threading.Event) -> Due:
        """Wait until `ahead_s` before an event is due, or until it is to stop."""
        while True:
            due = self.due(time_s)
            early_s = (due.frame - due.mixer.frames) / due.mixer.rate_hz - ahead_s
            if early_s <= 0 or stopping.wait(min(early_s, LOOK_S)):
                return due
