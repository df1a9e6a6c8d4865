"""A list of events handed over before its time, by a clock of frames that only the playback's own thread moves."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from app.instrument.events import KEYS, NOTES_OFF, Bend, Controller, Event, NoteOff, NoteOn, TimedEvent, release_all
from app.playing.due import Due
from app.playing.playback import AHEAD_S, Playback
from engine.voices import Mixer

RATE_HZ = 48_000
Wait = Callable[[Callable[[], bool]], None]


class TurnedClock:
    """Frames are taken by each reader, a block at each look: no other thread is waited for."""

    def __init__(self, block: int = 480, buffer_s: float = 0.0) -> None:
        self.standing, self.block, self.buffer_s = Mixer(RATE_HZ), block, buffer_s

    @property
    def mixer(self) -> Mixer:
        self.standing.render(self.block)
        return self.standing


@dataclass
class Player:
    """Notes what it is given."""

    clock: TurnedClock
    came: list[tuple[Event, Due | None]] = field(default_factory=list)
    early: list[int] = field(default_factory=list)  # by how many frames
    cancelled: int = 0
    ended: threading.Event = field(default_factory=threading.Event)

    def handle(self, event: Event, due: Due | None) -> None:
        self.came.append((event, due))
        if due is not None:
            self.early.append(due.frame - self.clock.standing.frames)

    def cancel(self) -> None:
        self.cancelled += 1

    def plays(self, *events: TimedEvent) -> Playback:
        playback = Playback(self.handle, self.clock, self.cancel, self.ended.set)
        playback.play(events)
        return playback

    @property
    def events(self) -> list[Event]:
        return [event for event, _ in self.came]


def frames(player: Player) -> list[int]:
    """Of what was played, after the first."""
    found = [due.frame for _, due in player.came if due is not None]
    return [frame - found[0] for frame in found]


def test_each_event_is_handed_over_before_its_frame_and_everything_is_let_go_in_the_end() -> None:
    player = Player(TurnedClock())
    player.plays(TimedEvent(0.2001, NoteOff(60)), TimedEvent(0.0, NoteOn(60, 90)), TimedEvent(0.1, NoteOn(64, 90)))
    assert player.ended.wait(10)
    assert player.events == [NoteOn(60, 90), NoteOn(64, 90), NoteOff(60), *release_all([0])]
    assert frames(player)[:3] == [0, 4_800, 9_605]
    assert set(frames(player)[3:]) == {9_605}, "with the last event"
    assert all(0 < early <= AHEAD_S * RATE_HZ for early in player.early)
    assert player.cancelled == 0
    assert player.clock.standing.frames >= player.came[-1][1].frame, "it ends when the last event counts"  # type: ignore[union-attr]


@pytest.mark.parametrize("buffer_s", [0.0, 0.1])
def test_a_device_that_takes_much_at_once_is_given_events_so_much_earlier(buffer_s: float) -> None:
    player = Player(TurnedClock(block=round(buffer_s * RATE_HZ) or 480, buffer_s=buffer_s))
    player.plays(*(TimedEvent(0.25 * number, NoteOn(60, 90)) for number in range(5)))
    assert player.ended.wait(10)
    assert min(player.early[:5]) > 0.02 * RATE_HZ
    assert frames(player)[:5] == [12_000 * number for number in range(5)]


def test_a_thread_that_was_held_up_keeps_the_frames_of_what_follows() -> None:
    player = Player(TurnedClock())
    playback = Playback(player.handle, player.clock, player.cancel, player.ended.set)
    kept = player.handle

    def late(event: Event, due: Due | None) -> None:
        kept(event, due)
        player.clock.standing.render(round(0.04 * RATE_HZ))

    playback._handle = late
    playback.play([TimedEvent(0.05 * number, NoteOn(60 + number, 90)) for number in range(8)])
    assert player.ended.wait(10)
    assert frames(player)[:8] == [2_400 * number for number in range(8)]
    assert min(player.early[:8]) > 0


def test_it_can_be_stopped_and_lets_go_at_once(wait: Wait) -> None:
    player = Player(TurnedClock())
    playback = player.plays(TimedEvent(0.0, NoteOn(60, 90)), TimedEvent(600.0, NoteOff(60)))
    wait(lambda: player.came != [])
    playback.stop()
    assert not playback.playing
    assert player.cancelled == 1
    assert player.came[1:] == [(event, None) for event in release_all([0])]
    assert player.came[-1] == (Controller(NOTES_OFF, 0), None)
    playback.stop()
    assert player.cancelled == 1


def test_wheels_and_pedals_of_every_channel_are_at_rest_when_it_ends_within_a_bend() -> None:
    player = Player(TurnedClock())
    played: list[Event] = [NoteOn(60, 90), Bend(1.0), NoteOn(64, 90, 5), Bend(-0.5, 5), NoteOn(65, 90, KEYS)]
    player.plays(*(TimedEvent(0.0, event) for event in played))
    assert player.ended.wait(10)
    assert player.events == [*played, *release_all([0, 5, KEYS])]
    bends = [event for event in player.events[5:] if isinstance(event, Bend)]
    assert bends == [Bend(0.0), Bend(0.0, 5), Bend(0.0, KEYS)]


def test_with_another_mixer_it_goes_on_from_where_it_was() -> None:
    player, late = Player(TurnedClock()), Mixer(44_100)
    kept = player.handle

    def changes(event: Event, due: Due | None) -> None:
        kept(event, due)
        if event == NoteOn(62, 90):
            player.clock.standing = late

    playback = Playback(changes, player.clock, player.cancel, player.ended.set)
    playback.play([TimedEvent(0.1 * number, NoteOn(60 + number, 90)) for number in range(6)])
    assert player.ended.wait(10)
    dues = [due for _, due in player.came[:6] if due is not None]
    assert [due.mixer is late for due in dues] == [False] * 3 + [True] * 3
    assert dues[4].frame - dues[3].frame == 4_410
    assert dues[3].frame == pytest.approx((0.1 + AHEAD_S) * 44_100, abs=1_000), "a tenth later, as the one before"
    assert dues[3].frame_in(late) == dues[3].frame
    assert dues[0].frame_in(late) == 0


def test_what_is_due_is_reported_by_the_clock_of_recordings() -> None:
    player, began_s = Player(TurnedClock()), time.monotonic()
    player.plays(TimedEvent(0.0, NoteOn(60, 90)), TimedEvent(0.3, NoteOn(60, 90)))
    assert player.ended.wait(10)
    time_s = [due.time_s for _, due in player.came[:2] if due is not None]
    assert time_s[1] - time_s[0] == pytest.approx(0.3)
    assert began_s + AHEAD_S <= time_s[0] < began_s + 5
