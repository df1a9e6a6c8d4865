"""The combination of several recordings of one instrument: what they share, and what each adds.

The first gives the string and the recorded note. Takes of its pitch share their poles (`fit.fit_takes`),
and the medians of their partials' levels. Notes of every pitch share the smooth decay. So one take's accident does
not become the instrument's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from engine.resonators.recorded import OF_PARTIALS, RecordedString
from engine.values.string import StringParameters
from training.recording.learn import SAME_PITCH_CENTS, Learned
from training.recording.physics import corrections
from training.recording.preset import recorded_note, recorded_string
from training.recording.report import figures


def combined(learned: Sequence[Learned], settings: dict[str, Any]) -> RecordedString:
    """The additions of all recordings to the string of the first."""
    first = learned[0]
    note = recorded_note(first.note, first.fitted, first.source)
    first_string = recorded_string(note, first.physics, first.strung, first.source, settings, figures(first.report))
    others = [corrections(take.physics, _of_pitch(first.strung.string, first, take)) for take in learned[1:]]
    if not others:
        return first_string
    hz = np.log(first_string.smooth_hz)
    smooth = [np.log(first_string.smooth_ratio)]
    smooth += [np.interp(hz, np.log(take["smooth_hz"]), np.log(take["smooth_ratio"])) for take in others]
    same = [take for take, one in zip(others, learned[1:], strict=True) if abs(_cents(first, one)) < SAME_PITCH_CENTS]
    shared: dict[str, Any] = {
        name: tuple(
            float(np.median([own_value, *(take[name][place] for take in same if place < len(take[name]))]))
            for place, own_value in enumerate(getattr(first_string, name))
        )
        for name in OF_PARTIALS
    }
    return replace(first_string, smooth_ratio=tuple(np.exp(np.mean(smooth, axis=0)).tolist()), **shared)


def _cents(first: Learned, other: Learned) -> float:
    return 1200 * math.log2(other.physics.f0_hz / first.physics.f0_hz)


def _of_pitch(string: StringParameters, first: Learned, other: Learned) -> StringParameters:
    """The string, shortened to another note's pitch."""
    return replace(string, length_m=string.length_m * first.physics.f0_hz / other.physics.f0_hz)
