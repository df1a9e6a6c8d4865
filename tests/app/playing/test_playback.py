from __future__ import annotations

import threading
import time

from app.instrument.events import KEYS, NOTES_OFF, Bend, Controller, Event, NoteOff, NoteOn, TimedEvent, let_go
from app.playing.playback import Playback


def test_events_come_in_time_and_everything_is_let_go_in_the_end() -> None:
    came: list[tuple[float, Event]] = []
    ended = threading.Event()
    playback = Playback(lambda event: came.append((time.monotonic(), event)), ended.set)
    began_s = time.monotonic()  # each event may be late by itself, and none is early
    playback.play([TimedEvent(0.2, NoteOff(60)), TimedEvent(0.0, NoteOn(60, 90)), TimedEvent(0.1, NoteOn(64, 90))])
    assert ended.wait(10)
    times = [when - began_s for when, _ in came]
    assert [event for _, event in came[:3]] == [NoteOn(60, 90), NoteOn(64, 90), NoteOff(60)]
    assert times[1] >= 0.1
    assert times[2] >= 0.2
    assert came[-1][1] == Controller(NOTES_OFF, 0)


def test_it_can_be_stopped_and_lets_go() -> None:
    came: list[Event] = []
    playback = Playback(came.append)
    playback.play([TimedEvent(0.0, NoteOn(60, 90)), TimedEvent(600.0, NoteOff(60))])
    while not came:
        time.sleep(0.01)
    playback.stop()
    assert not playback.playing
    assert came[-1] == Controller(NOTES_OFF, 0)
    playback.stop()


def test_wheels_and_pedals_of_every_channel_are_at_rest_when_it_ends_within_a_bend() -> None:
    came: list[Event] = []
    ended = threading.Event()
    played: list[Event] = [NoteOn(60, 90), Bend(1.0), NoteOn(64, 90, 5), Bend(-0.5, 5), NoteOn(65, 90, KEYS)]
    Playback(came.append, ended.set).play([TimedEvent(0.0, event) for event in played])
    assert ended.wait(10)
    assert came == [*played, *let_go([0, 5, KEYS])]
    assert [event for event in came[5:] if isinstance(event, Bend)] == [Bend(0.0), Bend(0.0, 5), Bend(0.0, KEYS)]
