"""Two sounds side by side, one of which is heard: looped, and switched without a click."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from engine.voices import Mixer, Voice, plain_program

STOP_S = 0.012


class Pair:
    """Two sounds that loop together, of which one is heard. For one thread.

    Args:
        samples: name -> (frames, channels) at the mixer's rate, all of one length.
    """

    def __init__(self, mixer: Mixer, samples: Mapping[str, NDArray[np.float32]]) -> None:
        self.mixer, self._samples = mixer, samples
        self._voices: dict[str, Voice] = {}  # by name; empty: nothing sounds
        self._heard = ""  # name of the one that is heard; "": none

    def select(self, name: str) -> None:
        """Set which one is heard; where they sound, it is a cross-fade."""
        self._heard = name
        for source, voice in self._voices.items():
            voice.set_gain(float(source == name))

    def play(self, restart: bool = False) -> None:
        """Start both where nothing sounds, or on `restart`; otherwise they continue."""
        if self._voices and not restart:
            return
        self.stop()
        for name, samples in self._samples.items():
            voice = Voice.of_samples(plain_program(self.mixer.rate_hz), samples)
            voice.loop()
            voice.begin_at_once()  # the samples have a fade-in of their own, or none that may be added
            voice.start_with_gain(float(name == self._heard))
            self._voices[name] = voice
        self.mixer.add(*self._voices.values())

    def stop(self) -> None:
        """Fade both out."""
        for voice in self._voices.values():
            voice.release(STOP_S)
        self._voices = {}
