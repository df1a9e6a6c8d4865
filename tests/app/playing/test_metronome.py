"""The metronome's clicks, found in what a mixer gives, sample by sample."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from app.player.events import Meter
from app.playing.metronome import Metronome, click
from app.playing.playback import AHEAD_S
from engine.voices import Mixer


class Room:
    """A mixer without limiter, whose frames are taken in pieces while the metronome is looked at."""

    def __init__(self) -> None:
        self.sound: Any = SimpleNamespace(mixer=Mixer(48_000, limited=False), buffer_s=0.0)
        self.metronome = Metronome(self.sound)
        self.sound.mixer.render(777)

    def heard(self, seconds: float) -> np.ndarray:
        pieces = []
        for _ in range(round(seconds * self.sound.mixer.rate_hz / 480)):
            pieces.append(self.sound.mixer.render(480)[:, 0])
            self.metronome.look()
        return np.concatenate(pieces)


def test_clicks_are_at_the_frames_of_their_beats_accented_in_each_bar_and_end_at_once():
    room, tempo_bpm, rate_hz = Room(), 97, 48_000
    beat_s = 60 / tempo_bpm
    for metronome, clicks in ((True, 9), (False, 6)):
        choices = Meter(tempo_bpm=tempo_bpm, beats=3, count_in_bars=2, metronome=metronome)
        room.metronome.begin(choices)
        heard, wanted = room.heard(8.5 * beat_s + AHEAD_S), np.zeros(2**20, np.float32)
        for beat in range(clicks):
            frame = round(AHEAD_S * rate_hz) + round(beat * beat_s * rate_hz)
            sound = click(rate_hz, beat % 3 == 0)[:, 0]
            wanted[frame : frame + len(sound)] += sound
        np.testing.assert_allclose(heard, wanted[: len(heard)], atol=1e-4)
        room.metronome.end()
        assert np.abs(room.heard(3 * beat_s)).max() < 1e-4


def test_another_device_continues_with_the_beat():
    room, first = Room(), 777 + round(AHEAD_S * 48_000)
    room.metronome.begin(Meter(tempo_bpm=240, metronome=True))
    room.heard(1.1)
    played_s = (room.sound.mixer.frames - first) / 48_000
    room.sound.mixer = Mixer(44_100, limited=False)
    room.metronome.look()
    heard, wanted = room.heard(2.0), np.zeros(2**20, np.float32)
    for beat in range(9, 14):
        frame, sound = round(beat * 11_025) - round(played_s * 44_100), click(44_100, beat % 4 == 0)[:, 0]
        wanted[frame : frame + len(sound)] += sound
    np.testing.assert_allclose(heard, wanted[: len(heard)], atol=1e-4)
