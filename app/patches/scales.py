"""Scales by their formulas, as the texts of .scl files."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from fractions import Fraction

OCTAVE, FIFTH, THIRD = Fraction(2), Fraction(3, 2), Fraction(5, 4)
PYTHAGOREAN_COMMA, SYNTONIC_COMMA = FIFTH**12 / OCTAVE**7, FIFTH**4 / OCTAVE**2 / THIRD
Pitch = Fraction | float  # a ratio, or cents


def cents_of(ratio: Fraction) -> float:
    return 1200 * (math.log2(ratio.numerator) - math.log2(ratio.denominator))


def _text(name: str, pitches: Iterable[Pitch]) -> tuple[str, str]:
    """The name and the text of a scale, whose last pitch is the interval of repetition."""
    lines = [
        f"{pitch.numerator}/{pitch.denominator}" if isinstance(pitch, Fraction) else f"{pitch:.6f}"
        for pitch in pitches
    ]
    return name, "\n".join([name, str(len(lines)), *lines, ""])


def _equal(steps: int, chosen: Iterable[int] = (), interval: Fraction = OCTAVE) -> list[Pitch]:
    """Some or all of so many equal steps in an interval, which is the last pitch."""
    return [*(cents_of(interval) * step / steps for step in chosen or range(1, steps)), interval]


def _lattice(fifths: Iterable[int], thirds: Iterable[int]) -> list[Pitch]:
    """All sums of so many pure fifths and so many pure thirds, in one octave."""
    ratios = [FIFTH**fifth * THIRD**third for fifth in fifths for third in thirds]
    ratios = sorted(ratio / OCTAVE ** math.floor(math.log2(ratio)) for ratio in ratios if ratio != 1)
    return [*ratios, OCTAVE]


def _tempered(narrowed_cents: Mapping[int, float]) -> list[Pitch]:
    """Twelve notes on a chain of eleven fifths, by how much each is narrowed.

    Args:
        narrowed_cents: by the place of the lower note, in fifths from the first of the scale, C; from the flat side.
    """
    place_cents, cents = {min(narrowed_cents): 0.0}, 0.0
    for place, narrowed in sorted(narrowed_cents.items()):
        cents += cents_of(FIFTH) - narrowed
        place_cents[place + 1] = cents
    return [*sorted((cents - place_cents[0]) % 1200 for place, cents in place_cents.items() if place), OCTAVE]


def _narrowed(first: int, comma: Fraction, part: float, places: Iterable[int]) -> dict[int, float]:
    """Eleven fifths, those of `places` narrowed by a part of a comma."""
    return {**dict.fromkeys(range(first, first + 11), 0.0), **dict.fromkeys(places, part * cents_of(comma))}


_MEANTONE = _narrowed(-3, SYNTONIC_COMMA, 1 / 4, range(-3, 8))
_WERCKMEISTER = _narrowed(-5, PYTHAGOREAN_COMMA, 1 / 4, (0, 1, 2, 5))  # C–G–D–A, B–F♯
_KIRNBERGER = _narrowed(-5, SYNTONIC_COMMA, 1 / 4, range(4))  # C–G–D–A–E; D♭–F♯, which closes the circle, by the rest
_VALLOTTI = _narrowed(-5, PYTHAGOREAN_COMMA, 1 / 6, range(-1, 5))  # F–C–G–D–A–E–B
SCALES: dict[str, str] = dict(
    (
        _text("19 equal steps", _equal(19)),
        _text("24 equal steps (quarter tones)", _equal(24)),
        _text("31 equal steps", _equal(31)),
        _text("Pythagorean (E♭ to G♯)", _lattice(range(-3, 9), (0,))),
        _text("Quarter-comma meantone (E♭ to G♯)", _tempered(_MEANTONE)),
        _text("Just intonation (5-limit)", _lattice(range(-1, 3), (-1, 0, 1))),
        _text("Harmonics 8 to 16", [Fraction(harmonic, 8) for harmonic in range(9, 17)]),
        _text("Werckmeister III", _tempered(_WERCKMEISTER)),
        _text("Kirnberger III", _tempered(_KIRNBERGER)),
        _text("Vallotti", _tempered(_VALLOTTI)),
        _text("Slendro, nearly: 5 equal steps", _equal(5)),
        _text("Pelog, nearly: 7 of 9 equal steps", _equal(9, (1, 2, 4, 5, 6, 7))),
        _text("Bohlen–Pierce (13 equal steps of 3/1)", _equal(13, interval=Fraction(3))),
    )
)
