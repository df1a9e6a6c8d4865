"""The effect of a recording on a key's string: as `engine.resonators.recorded.RecordedString.resonator`.

Each partial has two modes, side by side, of the first and of the second polarisation. What single partials of the
recorded note add to the law fades with the distance of the string in pitch, to what the note has at that frequency.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.kernels import constants as of
from engine.kernels import strings
from engine.kernels.memory import address_of, behind, recorded_at
from engine.kernels.records import RECORDED, Recorded, Table
from engine.kernels.strings import EXACT

HEADER = RECORDED.itemsize // 8


@njit(**EXACT)
def _of(table: Table) -> Recorded:
    return recorded_at(address_of(table) + 8 * table.recorded)


@njit(**EXACT)
def modes_of(table: Table, partials: int) -> int:
    """The number of modes of so many partials: as `PresetInfo.modes_of`."""
    return min(2 * partials, _of(table).modes)


@njit(**EXACT)
def _above(table: Table, string: np.ndarray) -> float:
    """The pitch of a string over that of the recorded note."""
    hz = math.sqrt(strings.omega_squared(string, 1)) / (2 * math.pi)
    return hz / _of(table).pitch_hz


@njit(**EXACT)
def _own(table: Table, which: int, partial: int, above: float) -> float:
    """The value `which`, of five, of a partial, from 0; ratios fade by their logarithms."""
    recorded = _of(table)
    rest, known = recorded.rest[which], recorded.partials
    row = behind(recorded, HEADER + 2 * recorded.smooth + which * known, known)
    value, there = rest, round((partial + 1) * above) - 1  # the note's partial of nearly the same frequency
    if partial < known:
        value = row[partial]
    if which != of.CENTS and 0 <= there < known:
        rest = row[there]
    away = 12 * math.log2(above) / of.FADES_SEMITONES
    near = math.exp(-away * away)
    if which == of.RATIO or which == of.SECOND_RATIO:
        return math.exp(near * math.log(value) + (1 - near) * math.log(rest))
    return near * value + (1 - near) * rest


@njit(**EXACT)
def _smooth(table: Table, hz: float) -> float:
    """The decay over that of the law at a frequency: even between points, in logarithms."""
    count = _of(table).smooth
    frequencies, ratios = behind(_of(table), HEADER, count), behind(_of(table), HEADER + count, count)
    wanted, place = math.log(hz), 0
    while place < count and frequencies[place] <= wanted:
        place += 1
    if place == 0:
        return math.exp(ratios[0])
    if place == count:
        return math.exp(ratios[count - 1])
    low, high = frequencies[place - 1], frequencies[place]
    share = (wanted - low) / (high - low)
    below, above = ratios[place - 1], ratios[place]
    return math.exp(below + share * (above - below))


@njit(**EXACT)
def split(table: Table, string: np.ndarray, modes: int, amplitudes: np.ndarray) -> None:
    """Splits a pluck's partials, the first of `amplitudes` (modes,), into the modes of both polarisations."""
    above = _above(table, string)
    for mode in range(modes - 1, -1, -1):
        share = _own(table, of.SECOND_SHARE, mode // 2, above)
        amplitudes[mode] = amplitudes[mode // 2] * (share if mode % 2 == 1 else 1 - share)


@njit(**EXACT)
def correct(table: Table, string: np.ndarray, modes: int, rows: np.ndarray) -> None:
    """Changes ω² and σ of the law, the first two rows of `rows` (4 modes,), to those of the recorded string."""
    above, highest = _above(table, string), 0.0
    for mode in range(modes):
        partial = mode // 2
        omega, sigma = math.sqrt(rows[mode]), rows[modes + mode]
        first = omega * 2.0 ** (_own(table, of.CENTS, partial, above) / 1200)
        sigma *= _smooth(table, omega / (2 * math.pi)) * _own(table, of.RATIO, partial, above)
        sigma = min(sigma, of.HIGHEST_SIGMA * first)
        if mode % 2 == 1:
            first *= 2.0 ** (_own(table, of.SECOND_CENTS, partial, above) / 1200)
            sigma = min(sigma * _own(table, of.SECOND_RATIO, partial, above), of.HIGHEST_SIGMA * first)
        highest = max(highest, first)  # the order of modes stays
        rows[mode] = highest * highest
        rows[modes + mode] = sigma
