"""Scales by their formulas, as the texts of .scl files."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable


def _cents(ratio: float) -> float:
    return 1200 * math.log2(ratio)


OCTAVE, FIFTH, THIRD = _cents(2), _cents(3 / 2), _cents(5 / 4)
PYTHAGOREAN_COMMA, SYNTONIC_COMMA = 12 * FIFTH - 7 * OCTAVE, 4 * FIFTH - 2 * OCTAVE - THIRD


def _equal(steps: int, interval: float = OCTAVE) -> list[float]:
    return [interval * step / steps for step in range(1, steps + 1)]


def _in_octave(pitches: Iterable[float]) -> list[float]:
    """The pitches in cents, moved into one octave, ascending; the first note becomes the octave, 1200."""
    return sorted(pitch % OCTAVE or OCTAVE for pitch in pitches)


def _fifths(first: int, comma: float = 0.0, narrowed: Collection[int] = ()) -> list[float]:
    """Twelve notes on a chain of fifths, in cents above C within an octave, ascending.

    Args:
        first: the place of the first note, in fifths from C.
        comma: how much smaller the narrowed fifths are, in cents.
        narrowed: the places of the lower notes of these fifths.
    """
    sizes = {place: FIFTH - comma * (place in narrowed) for place in range(first, first + 11)}
    below = -sum(sizes[place] for place in range(first, 0))
    return _in_octave(below + sum(sizes[each] for each in range(first, place)) for place in range(first, first + 12))


FORMULAS = {
    "19 equal steps": _equal(19),
    "24 equal steps (quarter tones)": _equal(24),
    "31 equal steps": _equal(31),
    "Pythagorean (E♭ to G♯)": _fifths(-3),
    "Quarter-comma meantone (E♭ to G♯)": _fifths(-3, SYNTONIC_COMMA / 4, range(-3, 8)),
    "Just intonation (5-limit)": _in_octave(m * FIFTH + n * THIRD for m in range(-1, 3) for n in (-1, 0, 1)),
    "Harmonics 8 to 16": [_cents(harmonic / 8) for harmonic in range(9, 17)],
    "Werckmeister III": _fifths(-5, PYTHAGOREAN_COMMA / 4, (0, 1, 2, 5)),  # C–G–D–A, B–F♯
    "Kirnberger III": _fifths(-5, SYNTONIC_COMMA / 4, range(4)),  # C–G–D–A–E
    "Vallotti": _fifths(-5, PYTHAGOREAN_COMMA / 6, range(-1, 5)),  # F–C–G–D–A–E–B
    "Slendro, nearly: 5 equal steps": _equal(5),
    "Pelog, nearly: 7 of 9 equal steps": [_equal(9)[step - 1] for step in (1, 2, 4, 5, 6, 7, 9)],
    "Bohlen–Pierce (13 equal steps of 3/1)": _equal(13, _cents(3)),
}
SCALES = {
    name: "\n".join([name, str(len(pitches)), *(f"{pitch:.6f}" for pitch in pitches), ""])
    for name, pitches in FORMULAS.items()
}
