"""A MIDI file that is played: play, stop and position, shown in the window."""

from __future__ import annotations

import time
from collections.abc import Sequence

from PySide6.QtCore import QObject

from app.player.events import NoteOff, NoteOn, TimedEvent
from app.playing.playback import Playback
from app.views.controls.song_strip import SongStrip


class SongPlayer(QObject):
    """A song, which lives in the window's thread. Times are in s from the beginning of the file."""

    def __init__(self, playback: Playback, strip: SongStrip) -> None:
        super().__init__(strip)
        self._playback, self._strip = playback, strip
        self._events: tuple[TimedEvent, ...] = ()
        self._from_s, self._began_s = 0.0, 0.0  # time in the file where it began or stands; when, by `time.monotonic`
        self._plays = False  # it was started, and has not been stopped or come to its end
        strip.play_asked.connect(self.play_or_stop)
        strip.seek_asked.connect(self.seek)
        strip.close_asked.connect(self.close)

    @property
    def playing(self) -> bool:
        return self._plays and self._playback.playing

    @property
    def length_s(self) -> float:
        return self._events[-1].time_s if self._events else 0.0

    @property
    def position_s(self) -> float:
        if not self._plays:
            return self._from_s
        return min(self._from_s + time.monotonic() - self._began_s, self.length_s)

    def load(self, name: str, events: Sequence[TimedEvent]) -> None:
        """Show a file and play it from its beginning."""
        self._events = tuple(sorted(events, key=lambda timed_event: timed_event.time_s))
        self._strip.show_song(name, self.length_s)
        self.play(0.0)

    def play(self, from_s: float) -> None:
        """Play the file from a time on, in place of what was played."""
        self._from_s = from_s
        self._began_s = time.monotonic()
        self._plays = True
        self._playback.play(events_from(self._events, from_s))
        self.tick()

    def stop(self) -> None:
        """Pause the song where it is."""
        if self._plays:
            self._from_s, self._plays = self.position_s, False
            self._playback.stop()
        self.tick()

    def play_or_stop(self) -> None:
        if self.playing:
            self.stop()
        else:
            self.play(0.0 if self._from_s >= self.length_s else self._from_s)

    def seek(self, position_s: float) -> None:
        """Go to a time, and play on from there where it was playing."""
        position_s = min(max(position_s, 0.0), self.length_s)
        if self.playing:
            self.play(position_s)
        else:
            self._from_s = position_s
            self.tick()

    def close(self) -> None:
        """Stop and hide it."""
        self.stop()
        self._events, self._from_s = (), 0.0
        self._strip.hide()

    def tick(self) -> None:
        """Show the state; to be called a few times a second."""
        if not self._events:
            return
        if self._plays and not self._playback.playing:  # it came to its end
            self._from_s, self._plays = 0.0, False
        self._strip.show_position(self.position_s, self._plays)


def events_from(events: Sequence[TimedEvent], from_s: float) -> list[TimedEvent]:
    """Events from a time on, which becomes 0; pedals, wheels and others before it count at 0, notes do not."""
    later = []
    for timed_event in events:
        if timed_event.time_s >= from_s:
            later.append(TimedEvent(timed_event.time_s - from_s, timed_event.event))
        elif not isinstance(timed_event.event, NoteOn | NoteOff):
            later.append(TimedEvent(0.0, timed_event.event))
    return later
