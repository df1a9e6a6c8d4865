"""A metronome and count-in beside a recording.

Each click is a voice of the mixer at the frame of its beat, handed over ahead. A recording holds events, from which
its files are made, so that no click is in them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.instrument.events import Meter
from app.playing.playback import AHEAD_S, Beginning
from engine.voices import Mixer, Voice, plain_program

if TYPE_CHECKING:
    from app.playing.notes import Notes

CLICKS_AHEAD_S = 1.0  # lead of clicks: so long the window's timer may stand still
PITCHES_HZ, DECAY_S, CLICK_S, LEVEL = (1318.5, 1760.0), 0.008, 0.06, 0.25  # of a beat, of the first in a bar
STOP_S = 0.005


class Metronome:
    """A metronome, whose methods belong to the window's thread.

    Args:
        notes: have the mixer, whose frames are its time.
    """

    def __init__(self, notes: Notes) -> None:
        self._notes = notes
        self._choices = Meter()
        self._beginning: Beginning | None = None
        self._mixer: Mixer | None = None
        self._next = 0  # beat, from the first of the count-in
        self._voices: list[Voice] = []  # the latest clicks

    def begin(self, choices: Meter) -> float:
        """Begin the count-in; return when the first beat after it is, on the clock of `time.monotonic`."""
        self._choices, self._voices = choices, []
        self._beginning = Beginning(self._notes, AHEAD_S + self._notes.buffer_s)
        self._mixer, self._next = None, 0
        self.look()
        return self._beginning.due(self._counted * 60 / choices.tempo_bpm).time_s

    def look(self) -> None:
        """Hand over the clicks of the next CLICKS_AHEAD_S; to be called a few times a second."""
        while self._beginning is not None:
            due = self._beginning.due(self._next * 60 / self._choices.tempo_bpm)
            if self._mixer is not due.mixer:  # which has none of the clicks
                self._mixer, self._next = due.mixer, 0
                continue
            early_s = (due.frame - due.mixer.frames) / due.mixer.rate_hz
            if early_s > CLICKS_AHEAD_S:
                return
            if early_s >= 0 and (self._choices.metronome or self._next < self._counted):
                accented = self._next % self._choices.beats == 0
                voice = Voice.of_samples(plain_program(due.mixer.rate_hz), click(due.mixer.rate_hz, accented))
                voice.begin_at_once()
                voice.begin_at(due.frame)
                due.mixer.add(voice)
                self._voices = [*(each for each in self._voices if not each.over), voice]
            self._next += 1

    def end(self) -> None:
        """End it, with the clicks that are still to come."""
        self._beginning = None
        for voice in self._voices:
            voice.release(STOP_S)

    @property
    def _counted(self) -> int:
        """The beats of the count-in."""
        return self._choices.count_in_bars * self._choices.beats


def click(rate_hz: int, accented: bool) -> NDArray[np.float32]:
    """The samples (frames, 1) of a click."""
    time_s = np.arange(round(CLICK_S * rate_hz)) / rate_hz
    sound = LEVEL * np.sin(2 * np.pi * PITCHES_HZ[accented] * time_s) * np.exp(-time_s / DECAY_S)
    return sound.astype(np.float32)[:, None]
