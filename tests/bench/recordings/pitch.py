"""How often the pitch of a note is found blind, from 27 Hz to 4 kHz."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from tests.bench.recordings.synthetic import synthetic_note
from training.recording.note import note_of
from training.recording.numbering import number_note

Recordings = Mapping[str, tuple[NDArray[np.float64], int]]

RANGE_HZ = (27.0, 4_000.0)
MIDDLE_HZ = 1_000.0
MOST_CENTS = 50.0
FIRST_SEED = 9_000
SECONDS = 1.5
HIGHEST_HZ = 14_000.0
OPEN_HZ = {"e6": 82.41, "a5": 110.0, "d4": 146.83, "g3": 196.0, "b2": 246.94, "e1": 329.63}  # strings of guitars
KEYS = {"c": 0, "d": 2, "e": 4, "f": 5, "g": 7, "a": 9, "b": 11}


def pitches(count: int, progress: Callable[[float], None]) -> dict[str, list[float]]:
    """Of synthetic notes, drawn evenly by pitch: 1 for each whose f0 lies within 50 cents, below and above 1 kHz."""
    values: dict[str, list[float]] = {}
    for number in range(count):
        progress(number / count)
        made = synthetic_note(FIRST_SEED + number, SECONDS, f0_range_hz=RANGE_HZ, highest_hz=HIGHEST_HZ)
        part = "below" if made.f0_hz < MIDDLE_HZ else "above"
        _note(values, f"synthetic {part} 1 kHz", made.samples, made.rate_hz, made.f0_hz)
    return values


def pitches_of(recordings: Recordings) -> dict[str, list[float]]:
    """The same of recordings whose names give the pitch: `bass_a2_…`, or the string of a guitar, `guitar_…_d4`."""
    values: dict[str, list[float]] = {}
    for name, (samples, rate_hz) in recordings.items():
        if (hz := _named_hz(name)) is not None:
            _note(values, "recordings", samples, rate_hz, hz)
    return values


def _note(
    values: dict[str, list[float]], part: str, samples: NDArray[np.float64], rate_hz: int, f0_hz: float
) -> None:
    series = number_note(note_of(samples, rate_hz))
    off = math.inf if series is None else abs(1200 * math.log2(series.f0_hz / f0_hz))
    values.setdefault(f"{part}, f0 within 50 cents", []).append(float(off <= MOST_CENTS))


def _named_hz(name: str) -> float | None:
    words = name.lower().split("_")
    if words[0] == "guitar":
        return OPEN_HZ.get(words[-1])
    for word in words[1:]:
        if len(word) == 2 and word[0] in KEYS and word[1].isdigit():
            return float(440 * 2 ** ((12 * (int(word[1]) + 1) + KEYS[word[0]] - 69) / 12))
    return None
