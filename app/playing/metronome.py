"""A metronome and count-in beside a recording, whose events, and so its files, have no click.

Each click is a voice of the mixer at the frame of its beat, handed over ahead.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from app.audio.sound import Sound
from app.player.events import Meter
from app.playing.playback import AHEAD_S, Beginning
from engine.voices import Voice, plain_program

CLICKS_AHEAD_S = 1.0  # clicks are handed over so early, for the window's timer may stand still as long
PITCHES_HZ = (1318.5, 1760.0)  # of a beat, of the first in a bar
DECAY_S = 0.008
CLICK_S = 0.06
LEVEL = 0.25  # of full scale
STOP_S = 0.005  # fade of a click that sounds at the end


class Metronome:
    """A metronome in the time of the sound's mixer. Its methods belong to the window's thread."""

    def __init__(self, sound: Sound) -> None:
        self._sound = sound
        self._meter = Meter()
        self._beginning: Beginning | None = None  # of the count-in; None: no click is due
        self._next = 0  # number of the next beat to hand over; 0: the first of the count-in
        self._voices: list[Voice] = []  # clicks that were handed over and are not over

    def begin(self, meter: Meter) -> float:
        """Begin the count-in; return the time of the first beat after it, in s on the clock of `time.monotonic`."""
        self._meter, self._next = meter, 0
        self._beginning = Beginning(self._sound, AHEAD_S + self._sound.buffer_s)
        self.look()
        return self._beginning.due(meter.count_in_beats * 60 / meter.tempo_bpm).time_s

    def look(self) -> None:
        """Hand over the clicks of the next CLICKS_AHEAD_S; to be called a few times a second."""
        while self._beginning is not None:
            due = self._beginning.due(self._next * 60 / self._meter.tempo_bpm)
            rate_hz = due.mixer.rate_hz
            early_s = (due.frame - due.mixer.frames) / rate_hz
            if early_s > CLICKS_AHEAD_S:
                return
            if early_s >= 0 and (self._meter.metronome or self._next < self._meter.count_in_beats):
                voice = Voice.of_samples(plain_program(rate_hz), click(rate_hz, self._next % self._meter.beats == 0))
                voice.begin_at_once()
                voice.begin_at(due.frame)
                due.mixer.add(voice)
                self._voices = [*(each for each in self._voices if not each.over), voice]
            self._next += 1

    def end(self) -> None:
        """End the metronome, and cancel the clicks that were already handed over."""
        self._beginning = None
        for voice in self._voices:
            voice.release(STOP_S)


def click(rate_hz: int, accented: bool) -> NDArray[np.float32]:
    """The samples (frames, 1) of a click; `accented`: of the first beat in a bar."""
    time_s = np.arange(round(CLICK_S * rate_hz)) / rate_hz
    sound = LEVEL * np.sin(2 * np.pi * PITCHES_HZ[accented] * time_s) * np.exp(-time_s / DECAY_S)
    return sound.astype(np.float32)[:, None]
