"""The transport of a MIDI file: it plays, stops where it is, goes elsewhere, and chases controllers."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from app.player.events import ControlChange, NoteOff, NoteOn, TimedEvent
from app.playing.playback import Playback
from app.views.controls.song_strip import SongStrip
from app.window import song as module
from app.window.song import SongPlayer, events_from

PEDAL, NOTE, END = ControlChange(64, 127, 0), NoteOn(60, 90, 0), NoteOff(60, 0)
EVENTS = (TimedEvent(0.5, PEDAL), TimedEvent(1.0, NOTE), TimedEvent(4.0, END))


class Played(Playback):
    """Remembers what it was given, and plays until it is stopped."""

    def __init__(self) -> None:
        self.events: list[TimedEvent] | None = None

    @property
    def playing(self) -> bool:
        return self.events is not None

    def play(self, events: Sequence[TimedEvent]) -> None:
        self.events = list(events)

    def stop(self) -> None:
        self.events = None


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now_s = [100.0]
    monkeypatch.setattr(module.time, "monotonic", lambda: now_s[0])
    return now_s


@pytest.fixture
def strip(qtbot: QtBot) -> SongStrip:
    made = SongStrip()
    qtbot.addWidget(made)
    return made


def test_it_plays_stops_where_it_is_goes_elsewhere_and_is_closed(
    qtbot: QtBot, strip: SongStrip, clock: list[float]
) -> None:
    assert events_from(EVENTS, 0.0) == list(EVENTS)
    assert events_from(EVENTS, 2.0) == [TimedEvent(0.0, PEDAL), TimedEvent(2.0, END)], "pedals are chased, notes not"
    played = Played()
    song = SongPlayer(played, strip)
    assert strip.isHidden()
    song.load("song.mid", EVENTS)
    assert not strip.isHidden() and strip.name.text() == "song.mid" and played.events == list(EVENTS)
    clock[0] += 1.5
    song.tick()
    assert strip.time.text() == "0:01 / 0:04"
    assert strip.slider.value() == 15
    qtbot.mouseClick(strip.play, Qt.MouseButton.LeftButton)
    assert (song.playing, song.position_s, strip.play.text()) == (False, 1.5, "▶")
    clock[0] += 9
    strip.slider.setFocus()
    qtbot.keyClick(strip.slider, Qt.Key.Key_Right)
    assert song.position_s == 2.5
    qtbot.mouseClick(strip.play, Qt.MouseButton.LeftButton)
    assert played.events == events_from(EVENTS, 2.5)
    qtbot.keyClick(strip.slider, Qt.Key.Key_Left)
    assert song.playing and played.events == events_from(EVENTS, 1.5)
    clock[0] += 4.5
    played.events = None  # at the end it goes back
    song.tick()
    assert (song.playing, song.position_s, strip.play.text()) == (False, 0.0, "▶")
    song.play(1.0)
    qtbot.mouseClick(strip.closer, Qt.MouseButton.LeftButton)
    assert played.events is None and strip.isHidden()
