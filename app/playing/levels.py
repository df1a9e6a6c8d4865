"""The level match: gains that bring all sources of a note to the level of the truth.

They are computed in the background.
"""

from __future__ import annotations

import math
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping

import numpy as np

from app.playing.note import PluckVoices
from app.playing.sources import Sources
from engine.voices import Mixer, Voice

MATCHED_S = 1.0  # from the pluck on: the part whose levels are compared
HIGHEST_RATE_HZ = 48_000  # at which they are
LARGEST_MATCH_DB = 40.0  # beyond this a source is silent rather than soft, and stays as it is
KEPT_MATCHES = 256
MOST_WAITING = 8


class Levels:
    """The levels of notes' sources, for any thread.

    Args:
        in_background: does work in another thread.
    """

    def __init__(self, sources: Sources, in_background: Callable[[Callable[[], None]], None]) -> None:
        self._sources, self._in_background = sources, in_background
        self._lock = threading.Lock()
        self._known: OrderedDict[tuple[object, ...], Mapping[str, float]] = OrderedDict()
        self._waiting: set[tuple[object, ...]] = set()

    def of(self, note: PluckVoices) -> Mapping[str, float] | None:
        """The gain by source; None: not known yet."""
        return self._known.get(note.matching_key) if note.match is None else note.match

    def ask(
        self, note: PluckVoices, rate_hz: int, take: Callable[[tuple[object, ...], Mapping[str, float]], None]
    ) -> None:
        """Compute the gains where they are not known and enough of the note is rendered; `take` is then called."""
        key = note.matching_key
        if note.match is not None or not all(voice.finished or voice.rendered_s >= MATCHED_S for voice in note.ahead):
            return
        with self._lock:
            if key in self._waiting or len(self._waiting) > MOST_WAITING:
                return
            self._waiting.add(key)
        self._in_background(lambda: take(key, self._match(note, min(rate_hz, HIGHEST_RATE_HZ))))

    def _match(self, note: PluckVoices, rate_hz: int) -> Mapping[str, float]:
        """Compute the gain of each source of a note, and keep it for notes of the same pluck and ear."""
        key = note.matching_key
        try:
            seconds = min([MATCHED_S, *(voice.rendered_s for voice in note.ahead)])  # a pluck may be shorter
            levels = {source: self._level(note, source, seconds, rate_hz) for source in note.voices}
        finally:
            with self._lock:
                self._waiting.discard(key)
        gains = {source: _match_gain(level, levels.get("truth", level)) for source, level in levels.items()}
        with self._lock:
            self._known[key] = gains
            while len(self._known) > KEPT_MATCHES:
                self._known.popitem(last=False)
        return gains

    def _level(self, note: PluckVoices, source: str, seconds: float, rate_hz: int) -> float:
        """Root mean square of the first `seconds`. 0 where it is not known, so that the source stays as it is."""
        subject, ear = note.subject(source), note.request.ear
        program = self._sources.program(subject, source, rate_hz)
        if program.rendered:
            return note.voices[source].level_of_samples(seconds) if ear.pickup != "velocity" else 0.0
        mixer = Mixer(rate_hz, limited=False)
        initial_m, begin = self._sources.begin(subject, source, rate_hz, note.request.pluck)
        mixer.add(Voice(program, initial_m, ear, begin=begin))
        sound = mixer.render(round(seconds * rate_hz))
        return math.sqrt(float(np.square(sound, dtype=np.float64).mean()))


def _match_gain(level: float, truth: float) -> float:
    limit = 10 ** (LARGEST_MATCH_DB / 20)
    gain = truth / level if level > 0 else 0.0
    return gain if 1 / limit <= gain <= limit else 1.0
