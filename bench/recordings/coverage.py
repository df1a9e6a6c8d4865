"""Shares of 95 % intervals of partials that hold the truth on synthetic notes, and the errors of their middles."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from tests.training.recording.synthetic import synthetic_note
from training.cli.console import ProgressReport
from training.recording.fit import fit_note
from training.recording.note import note_of
from training.recording.numbering import number_note

QUIETEST_DB = -50.0  # below a note's loudest partial: those below are not counted
NUMBERED_CENTS = 50.0
FIRST_SEED = 3_000  # `intervals.MODEL_ERRORS` was measured on notes of seeds below it
UNITS = {"hz": 1200 / math.log(2), "decay": 1.0, "level_db": 1.0}  # of the errors: cents, a share, dB


def measure(count: int, report: ProgressReport) -> dict[str, Any]:
    """Measure so many notes that no threshold was set on."""
    return {"intervals": coverage(range(FIRST_SEED, FIRST_SEED + count), lambda done: report(done / count))}


def coverage(seeds: Iterable[int], progress: Callable[[int], None] = lambda done: None) -> dict[str, float]:
    """The share, by figure, of partials whose interval holds the truth, its half width and the middle's error.

    Widths are medians, errors root mean squares, in cents, shares and dB. Also how many partials, and how many notes
    are misnumbered.
    """
    held: dict[str, list[float]] = {name: [] for name in UNITS}
    widths: dict[str, list[float]] = {name: [] for name in UNITS}
    errors: dict[str, list[float]] = {name: [] for name in UNITS}
    missed = 0
    for done, seed in enumerate(seeds):
        progress(done)
        made = synthetic_note(seed)
        note = note_of(made.samples, made.rate_hz)
        series = number_note(note)
        if series is None or abs(1200 * math.log2(series.f0_hz / made.f0_hz)) > NUMBERED_CENTS:
            missed += 1
            continue
        spreads = fit_note(note, series).spreads
        loudest = max(each.level_db for each in made.partials)
        for each in made.partials:
            if each.number not in spreads or each.level_db < loudest + QUIETEST_DB:
                continue
            for name, unit in UNITS.items():
                low, high = getattr(spreads[each.number], name)
                truth = getattr(each, name)
                held[name].append(float(low <= truth <= high))
                if name != "level_db":
                    low, high, truth = (math.log(value) for value in (low, high, truth))
                widths[name].append(unit * (high - low) / 2)
                errors[name].append(unit * ((low + high) / 2 - truth))
    found = {name: float(np.mean(values)) for name, values in held.items()}
    found |= {f"{name} half width": float(np.median(values)) for name, values in widths.items()}
    found |= {f"{name} error": math.sqrt(float(np.mean(np.square(values)))) for name, values in errors.items()}
    return {**found, "partials": len(held["hz"]), "misnumbered": missed}
