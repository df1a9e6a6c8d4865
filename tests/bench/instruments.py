"""timbre: that of the instruments, compared with real ones."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

import typer

from training.cli.arguments import Json, open_preset
from training.cli.console import Failure, print_json, print_table, progress, say

if TYPE_CHECKING:
    from tests.bench.timbre import Reference, Timbre

ACOUSTIC = ("guitar", "harp", "keys", "world")  # categories for whose plucked strings the general ranges hold
COLUMNS = {
    "centroid_hz": "centroid Hz",
    "rolloff_hz": "99 % Hz",
    "partial_10_db": "partial 10 dB",
    "between_db": "between dB",
    "below_db": "below dB",
    "ripple_db": "ripple dB",
    "t60_early_s": "T60 early s",
    "two_stage": "late/early",
    "hard_over_soft": "hard/soft",
    "two_notes_db": "two notes dB",
    "repeats_db": "repeats dB",
    "tone": "tone",
    "against_truth": "against truth",
}


def timbre(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAMES]", help="Names of instruments; default the factory's.")
    ] = None,
    json: Json = False,
) -> None:
    """Print the timbre of instruments with ranges of real ones.

    Each plays E3 (keyboards C4; else the nearest octave in its range) at velocity 100, by the model, without room.
    A figure in its range has a plus, one outside a minus. Distances of six instruments from one another follow.
    """
    from app.patches.library import SHIPPED, PatchError, find_patch, list_patches
    from tests.bench import timbre as of_timbre
    from tests.bench.timbre import BRIGHTEST_FIRST, LEAST_DISTANCE_DB, PAIRED, REFERENCES, distance_db, references_of

    try:
        entries = [find_patch(name) for name in names] if names else list_patches(SHIPPED)[0]
        entries = [entry for entry in entries if names or entry.patch.strings.kind != "drums"]
    except PatchError as error:
        raise Failure(str(error)) from error
    presets = {name: open_preset(name) for name in sorted({entry.patch.preset for entry in entries})}
    found: dict[str, Timbre] = {}
    ranges: dict[str, Mapping[str, Reference]] = {}
    with progress("bench timbre") as report:
        for number, entry in enumerate(entries):
            report(number / len(entries), entry.name)
            patch = entry.patch
            try:
                found[entry.name] = of_timbre.timbre(patch, presets[patch.preset])
            except ValueError as error:
                say(f"{entry.name}: {error}")
                continue
            acoustic = patch.category in ACOUSTIC and patch.pickup.kind != "velocity"
            ranges[entry.name] = references_of(entry.name, acoustic)
    pairs = {
        (one, other): distance_db(found[one], found[other])
        for one, other in itertools.combinations([name for name in PAIRED if name in found], 2)
    }
    if json:
        print_json(
            {
                "instruments": {
                    name: {
                        "figures": _figures(each),
                        "ranges": {figure: [r.low, r.high] for figure, r in ranges[name].items()},
                        "met": {figure: r.holds(_figures(each)[figure]) for figure, r in ranges[name].items()},
                    }
                    for name, each in found.items()
                },
                "distances_db": {f"{one}, {other}": value for (one, other), value in pairs.items()},
                "references": [
                    {"figure": r.figure, "low": r.low, "high": r.high, "taken": r.taken, "instruments": r.patches}
                    for r in REFERENCES
                ],
            }
        )
        return
    print_table(
        ("instrument", "key", *COLUMNS.values()),
        [
            [name, each.key, *(_cell(_figures(each)[column], ranges[name].get(column)) for column in COLUMNS)]
            for name, each in found.items()
        ],
    )
    if pairs:
        print(f"Spectral distance over eight partials, at least {LEAST_DISTANCE_DB:g} dB wanted:")
        print_table(("one", "other", "dB"), [[one, other, f"{value:.1f}"] for (one, other), value in pairs.items()])
    if all(name in found for name in BRIGHTEST_FIRST):
        centroids = [found[name].centroid_hz for name in BRIGHTEST_FIRST]
        order = ", ".join(f"{name} {hz:.0f} Hz" for name, hz in zip(BRIGHTEST_FIRST, centroids, strict=True))
        print(f"Brightest first wanted: {order} {'+' if centroids == sorted(centroids, reverse=True) else '-'}")
    print("Ranges:")
    print_table(
        ("figure", "from", "to", "instruments", "how it was taken"),
        [
            [r.figure, r.low, r.high, ", ".join(r.patches) or ("all" if r.everywhere else "acoustic"), r.taken]
            for r in REFERENCES
        ],
    )


def _figures(each: Timbre) -> dict[str, float]:
    return {**each.figures(), "two_stage": each.t60_late_s / each.t60_early_s}


def _cell(value: float, reference: Reference | None) -> str:
    shown = "-" if math.isnan(value) else f"{value:.0f}" if abs(value) >= 20 else f"{value:.2g}"
    return shown if reference is None else f"{shown} {'+' if reference.holds(value) else '-'}"
