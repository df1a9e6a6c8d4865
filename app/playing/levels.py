"""The level match: gains that bring all sources of a note to the level of the truth."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from app.playing.note import PluckVoices
from app.playing.sources import Sources
from engine.levels import MATCHED_S, match_gain
from engine.voices import Mixer

HIGHEST_RATE_HZ = 48_000  # levels are measured at the device's rate, but at no higher one


def level_match(sources: Sources, note: PluckVoices, rate_hz: int) -> Mapping[str, float]:
    """The factors, by source, that bring a note to the level of its truth; `rate_hz`: of the device."""
    seconds = min([MATCHED_S, *(samples.rendered_s for samples in note.ahead)])  # a pluck may be shorter
    rate_hz = min(rate_hz, HIGHEST_RATE_HZ)
    levels = {source: _level(sources, note, source, seconds, rate_hz) for source in note.voices}
    return {source: match_gain(level, levels.get("truth", level)) for source, level in levels.items()}


def _level(sources: Sources, note: PluckVoices, source: str, seconds: float, rate_hz: int) -> float:
    """Root mean square of the first `seconds`. 0 where it is not known, so that the source stays as it is."""
    request = note.request
    for samples in note.ahead:
        if samples.voice is note.voices[source]:
            return samples.level(seconds) if request.ear.pickup != "velocity" else 0.0
    mixer = Mixer(rate_hz, limited=False)
    mixer.add(sources.load(note.subject(source)).voice(source, request.pluck, request.ear, rate_hz))
    sound = mixer.render(round(seconds * rate_hz))
    return math.sqrt(float(np.square(sound, dtype=np.float64).mean()))
