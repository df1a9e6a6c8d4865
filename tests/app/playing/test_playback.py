"""A list of events handed over before its time, by a clock of frames that only the playback's own thread moves."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from app.player.events import KEYS, Bend, Event, NoteOff, NoteOn, TimedEvent, release_all
from app.playing.playback import AHEAD_S, Due, Playback
from engine.voices import Mixer

RATE_HZ = 48_000


@dataclass
class Player:
    """Notes what it is given; its frames are taken by each reader, a block at each look.

    Attributes:
        early: by how many frames each event came.
        hinder: is called after each event, as something that keeps the thread waiting.
    """

    block: int = 480
    buffer_s: float = 0.0
    standing: Mixer = field(default_factory=lambda: Mixer(RATE_HZ))
    came: list[tuple[Event, Due | None]] = field(default_factory=list)
    early: list[int] = field(default_factory=list)
    cancelled: int = 0
    ended: threading.Event = field(default_factory=threading.Event)
    hinder: Callable[[Event], object] = lambda event: None

    @property
    def mixer(self) -> Mixer:
        self.standing.render(self.block)
        return self.standing

    def handle(self, event: Event, due: Due | None) -> None:
        self.came.append((event, due))
        if due is not None:
            self.early.append(due.frame - self.standing.frames)
        self.hinder(event)

    def cancel(self) -> None:
        self.cancelled += 1

    def play(self, *events: tuple[float, Event], whole: bool = True) -> Playback:
        playback = Playback(self.handle, self, self.cancel, self.ended.set)
        playback.play([TimedEvent(*each) for each in events])
        assert not whole or self.ended.wait(20)
        return playback

    @property
    def events(self) -> list[Event]:
        return [event for event, _ in self.came]

    @property
    def dues(self) -> list[Due]:
        return [due for _, due in self.came if due is not None]

    @property
    def frames(self) -> list[int]:
        """Of what was played, after the first."""
        return [due.frame - self.dues[0].frame for due in self.dues]


def test_each_event_is_handed_over_before_its_frame_and_everything_is_let_go_in_the_end():
    player, began_s = Player(1_200), time.monotonic()
    player.play((0.2001, NoteOff(60)), (0.0, NoteOn(60, 90)), (0.1, NoteOn(64, 90)))
    assert player.events == [NoteOn(60, 90), NoteOn(64, 90), NoteOff(60), *release_all([0])]
    assert player.frames[:3] == [0, 4_800, 9_605] and set(player.frames[3:]) == {9_605}, "with the last event"
    assert all(0 < early <= AHEAD_S * RATE_HZ for early in player.early)
    assert player.cancelled == 0
    assert player.standing.frames >= player.dues[-1].frame, "it ends when the last event counts"
    first, second, *_ = (due.time_s for due in player.dues)
    assert second - first == pytest.approx(0.1) and began_s + AHEAD_S <= first < began_s + 20


@pytest.mark.parametrize(("buffer_s", "held_up_s", "apart"), [(0.0, 0.04, 2_400), (0.1, 0.0, 12_000)])
def test_a_thread_that_was_held_up_or_a_device_that_takes_much_at_once_keeps_the_frames(buffer_s, held_up_s, apart):
    player = Player(round(buffer_s * RATE_HZ) or 480, buffer_s)
    player.hinder = lambda event: player.standing.render(round(held_up_s * RATE_HZ))
    player.play(*((number * apart / RATE_HZ, NoteOn(60 + number, 90)) for number in range(6)))
    assert player.frames[:6] == [number * apart for number in range(6)]
    assert min(player.early[:6]) > (0.02 * RATE_HZ if buffer_s else 0)


def test_it_can_be_stopped_and_lets_go_of_every_channel_at_once(wait):
    player = Player()
    played: list[Event] = [NoteOn(60, 90), Bend(1.0), NoteOn(64, 90, 5), Bend(-0.5, 5), NoteOn(65, 90, KEYS)]
    playback = player.play(*((0.0, event) for event in played), (600.0, NoteOff(60)), whole=False)
    wait(lambda: len(player.came) == len(played))
    for _ in range(2):
        playback.stop()
        assert not playback.playing and player.cancelled == 1
    assert player.came[len(played) :] == [(event, None) for event in release_all([0, 5, KEYS])]


def test_with_another_mixer_it_goes_on_from_where_it_was():
    player, late = Player(), Mixer(44_100)
    player.hinder = lambda event: setattr(player, "standing", late if event == NoteOn(62, 90) else player.standing)
    player.play(*((0.1 * number, NoteOn(60 + number, 90)) for number in range(6)))
    dues = player.dues[:6]
    assert [due.mixer is late for due in dues] == [False] * 3 + [True] * 3
    assert dues[4].frame - dues[3].frame == 4_410
    assert dues[3].frame == pytest.approx((0.1 + AHEAD_S) * 44_100, abs=1_000), "a tenth later, as the one before"
    assert (dues[3].frame_in(late), dues[0].frame_in(late)) == (dues[3].frame, 0)
