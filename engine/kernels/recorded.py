"""The laws of a recorded string, for Python and compiled code, as `engine.kernels.strings`.

Each partial has two modes, side by side, of the first and of the second polarisation. What single partials of the
recorded note add to the law fades with the distance of the string in pitch. It ends at what the note has at that
frequency. So keys keep slow and fast partials, not their median: the bridge and the body, which make them, do not
move with the pitch.

`Additions` are the pitch of the note in Hz; what its five values fade to; log of frequencies and of ratios of decay
over that of the law (points,); the five values of its partials, (5, partials), in the order of `RecordedString`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, TypeAlias

from engine.kernels import constants as of
from engine.kernels import strings

if TYPE_CHECKING:
    import numpy as np

    from engine.kernels.strings import Out, Row

    Additions: TypeAlias = tuple[float, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def above(additions: Additions, string: Row) -> float:
    """The pitch of a string over that of the recorded note."""
    return math.sqrt(strings.omega_squared(string, 1)) / (2 * math.pi) / additions[0]


def value(additions: Additions, which: int, partial: int, higher: float) -> float:
    """The value `which`, CENTS … SECOND_SHARE, of a partial, from 0, of a string; ratios fade by logarithms.

    `higher`: the string's pitch over that of the recorded note, see `above`.
    """
    row, rest = additions[4][which], additions[1][which]
    known, there = len(row), round((partial + 1) * higher) - 1  # the note's partial of nearly the same frequency
    near = row[partial] if partial < known else rest
    if which != of.CENTS and 0 <= there < known:
        rest = row[there]
    away = 12 * math.log2(higher) / of.FADES_SEMITONES
    share = math.exp(-away * away)
    if which == of.RATIO or which == of.SECOND_RATIO:
        return math.exp(share * math.log(near) + (1 - share) * math.log(rest))
    return float(share * near + (1 - share) * rest)


def smooth(additions: Additions, hz: float) -> float:
    """The decay over that of the law at a frequency: even between points, in logarithms."""
    frequencies = additions[2]
    ratios = additions[3]
    wanted = math.log(hz)
    place = 0
    count = len(frequencies)
    while place < count and frequencies[place] <= wanted:
        place += 1
    if place == 0:
        return math.exp(ratios[0])
    if place == count:
        return math.exp(ratios[count - 1])
    share = (wanted - frequencies[place - 1]) / (frequencies[place] - frequencies[place - 1])
    return math.exp(ratios[place - 1] + share * (ratios[place] - ratios[place - 1]))


def split(additions: Additions, string: Row, modes: int, amplitudes: Out) -> None:
    """Split a pluck's partials, the first of `amplitudes` (modes,), into the modes of both polarisations."""
    higher = above(additions, string)
    for mode in range(modes - 1, -1, -1):
        second = value(additions, of.SECOND_SHARE, mode // 2, higher)
        amplitudes[mode] = amplitudes[mode // 2] * (second if mode % 2 == 1 else 1 - second)


def correct(additions: Additions, string: Row, modes: int, rows: Out) -> None:
    """Change ω² and σ of the law, the first two rows of `rows` (at least 2 modes,), to those of the recorded string.

    A key that is bent keeps the order of its modes.
    """
    higher, highest = above(additions, string), 0.0
    for mode in range(modes):
        partial = mode // 2
        omega, sigma = math.sqrt(rows[mode]), rows[modes + mode]
        first = omega * 2.0 ** (value(additions, of.CENTS, partial, higher) / 1200)
        sigma *= smooth(additions, omega / (2 * math.pi)) * value(additions, of.RATIO, partial, higher)
        sigma = min(sigma, of.HIGHEST_SIGMA * first)
        if mode % 2 == 1:
            first *= 2.0 ** (value(additions, of.SECOND_CENTS, partial, higher) / 1200)
            sigma = min(sigma * value(additions, of.SECOND_RATIO, partial, higher), of.HIGHEST_SIGMA * first)
        highest = max(highest, first)
        rows[mode] = highest * highest
        rows[modes + mode] = sigma
