"""How often the 95 % intervals of partials hold the truth, on synthetic notes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

from tests.bench.recordings.synthetic import synthetic_note
from training.recording.fit import fit_note
from training.recording.note import note_of
from training.recording.numbering import number_note

QUIETEST_DB = -50.0  # below a note's loudest partial: those below are not counted
NUMBERED_CENTS = 50.0
FIRST_SEED = 3_000  # the numbers of `intervals` were set on notes of seeds below it


def coverage(seeds: Iterable[int], progress: Callable[[int], None] = lambda done: None) -> dict[str, float]:
    """The share of partials whose interval holds the truth, by figure; how many partials, and notes misnumbered."""
    held: dict[str, int] = {"hz": 0, "decay": 0, "level_db": 0}
    partials = missed = 0
    for done, seed in enumerate(seeds):
        progress(done)
        made = synthetic_note(seed)
        note = note_of(made.samples, made.rate_hz)
        series, _ = number_note(note)
        if series is None or abs(1200 * math.log2(series.f0_hz / made.f0_hz)) > NUMBERED_CENTS:
            missed += 1
            continue
        spreads = fit_note(note, series).spreads
        loudest = max(each.level_db for each in made.partials)
        for each in made.partials:
            if each.number not in spreads or each.level_db < loudest + QUIETEST_DB:
                continue
            partials += 1
            for name in held:
                low, high = getattr(spreads[each.number], name)
                held[name] += low <= getattr(each, name) <= high
    shares = {name: count / max(1, partials) for name, count in held.items()}
    return {**shares, "partials": partials, "misnumbered": missed}
