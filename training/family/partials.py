"""Partials of a model of many strings: pitch after a quiet pluck; level, T60 and glide after each string's own."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from engine.partials import PartialErrors, PartialTrack, partial_errors, segment_frames, track_partials
from engine.true_partials import true_phasors
from training.family.errors import Player
from training.family.motions import substeps_of
from training.family.strings import Column, PluckedString, draw_string

QUIET_RISE = 1e-3  # of the tension at a quiet pluck: the first mode is a third to two thirds of a cent sharp
FRAMES_AT_ONCE = 4_800


@dataclass(frozen=True)
class Magnitudes:
    """Of one string's errors: of its partials the mean by energy, and the largest; NaN where none has a figure."""

    mean: float
    largest: float


@dataclass(frozen=True)
class StringPartials:
    """The errors of one string's partials within 60 dB of its loudest one.

    Attributes:
        quiet_cents: of frequency after a pluck that raises the tension by `QUIET_RISE`.
        quiet_first_cents: of the first mode's.
        level_db, t60_percent, glide_cents: after the string's own pluck, as `engine.partials` has them.
    """

    pitch_hz: float
    inharmonicity: float
    tension_rise: float
    quiet_first_cents: float
    quiet_cents: Magnitudes
    level_db: Magnitudes
    t60_percent: Magnitudes
    glide_cents: Magnitudes


@torch.inference_mode()
def measure_partials(
    play: Player,
    column: Column,
    split: str,
    count: int,
    rate_hz: int,
    seconds: float,
    *,
    seed: int = 0,
    report: Callable[[float], None] = lambda share: None,
) -> list[StringPartials]:
    """The errors of the partials over so many seconds, a string each."""
    found = []
    for number in range(count):
        plucked = draw_string(column, split, number, seed)
        softer = math.sqrt(QUIET_RISE / plucked.tension_rise)
        quiet = replace(plucked, amplitudes_m=softer * plucked.amplitudes_m, tension_rise=QUIET_RISE)
        soft, own = (_errors(play, pluck, rate_hz, seconds) for pluck in (quiet, plucked))
        found.append(
            StringPartials(
                plucked.pitch_hz,
                plucked.inharmonicity,
                plucked.tension_rise,
                abs(float(soft.cents[0, 0, 0])),
                _magnitudes(soft, soft.cents),
                _magnitudes(own, own.level_db),
                _magnitudes(own, own.t60_error_percent),
                _magnitudes(own, own.glide_error_cents),
            )
        )
        report((number + 1) / count)
    return found


def _errors(play: Player, plucked: PluckedString, rate_hz: int, seconds: float) -> PartialErrors:
    resonator, steps = plucked.resonator, round(seconds * rate_hz)
    linear_hz = (resonator.eigenvalues().imag / (2 * math.pi)).tolist()
    length = segment_frames(rate_hz, linear_hz[0])
    block = max(1, FRAMES_AT_ONCE // length) * length
    played = play(plucked, rate_hz, steps)[None].split(block, dim=1)
    substeps = substeps_of(resonator, rate_hz)
    true = true_phasors(resonator, plucked.amplitudes_m[None].numpy(), rate_hz, steps, block, substeps=substeps)
    tracks = [track_partials(predicted.numpy(), truth, length) for predicted, truth in zip(played, true, strict=True)]
    return partial_errors(PartialTrack.join(tracks), rate_hz, linear_hz, [(0.0, seconds)])


def _magnitudes(errors: PartialErrors, values: NDArray[np.float64]) -> Magnitudes:
    """Of the one trajectory and window."""
    size, energy = np.abs(values[0, 0]), errors.energy[0, 0]
    there = ~np.isnan(size)
    if not there.any():
        return Magnitudes(math.nan, math.nan)
    return Magnitudes(float(np.average(size[there], weights=energy[there])), float(size[there].max()))


def middle_and_worst(values: Sequence[float]) -> tuple[float | None, float | None, int | None]:
    """Median and largest of those that are numbers, and the place of the largest; None: there are none."""
    numbers = [(value, place) for place, value in enumerate(values) if not math.isnan(value)]
    if not numbers:
        return None, None, None
    return float(np.median([value for value, _ in numbers])), *max(numbers)
