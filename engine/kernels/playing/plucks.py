"""A pluck as amplitudes of partials: its shape, its release, its parts in both directions."""

from __future__ import annotations

import math

import numpy as np

from engine.bounds import LARGEST_AMPLITUDE_MM, POSITION_RANGE, WIDTH_RANGE
from engine.kernels import constants as of
from engine.kernels import pulses, recorded, strings, velocities
from engine.kernels.compiled import kernel
from engine.kernels.memory import behind, mixed
from engine.kernels.playing import keys
from engine.kernels.records import Player, Table
from engine.levels import MOST_PERIODS

LEAST_AMPLITUDE_MM = 1e-6  # -200 dB of the largest: silence, and no division by zero

# By how much a pluck varies from stroke to stroke, at most, where an instrument varies by 1. Estimates: repeats then
# differ by about -20 dB; those of a player that was recorded do by -4 … -12 dB
VARIES_PLACE = 0.08
VARIES_DB = 1.0
VARIES_WIDTH = 0.12  # shares, dB


@kernel
def pull(player: Player, table: Table, shape: int, modes: int, position: float, peak_m: float, width: float) -> float:
    """Write a pluck's amplitudes by partial into `player.amplitudes`, in m; return its highest point in m.

    They are the sines of its shape on a grid. Those of a blow are divided by its width, the shape's area over its
    height; `release_pluck` does the rest.

    Args:
        shape: GAUSSIAN … ROUNDED.
        modes: the number of partials.
        position, width: shares of the string's length.
        peak_m: height of the shape.
    """
    grid, highest = table.grid, 0.0
    sines = behind(table, table.sines, 2 * (grid - 1))
    if shape == of.ROUNDED:
        _round(player, sines, modes, position, peak_m, width)
        return peak_m
    for point in range(grid):
        x = point / (grid - 1)
        distance = (x - position) / width
        if shape == of.TRIANGULAR:
            height_m = peak_m * pulses.triangle(x, position)
        elif point == 0 or point == grid - 1:
            height_m = 0.0
        elif shape == of.GAUSSIAN:
            height_m = peak_m * pulses.gaussian(distance)
        else:
            height_m = peak_m * pulses.raised_cosine(distance)
        player.pulled[point] = height_m
        highest = max(highest, height_m)
    turn = 2 * (grid - 1)  # places of a whole turn of the tabulated sine
    for mode in range(modes):
        total, place = 0.0, 0
        for point in range(1, grid - 1):
            place += mode + 1
            if place >= turn:
                place -= turn
            total += player.pulled[point] * sines[place]
        player.amplitudes[mode] = total * (2 / (grid - 1))
    if table.strikes != 0:
        area = 0.0
        for point in range(grid):
            area += player.pulled[point] / (peak_m * (grid - 1))
        for mode in range(modes):
            player.amplitudes[mode] /= area
    return highest


@kernel
def _round(player: Player, sines: np.ndarray, modes: int, position: float, peak_m: float, width: float) -> None:
    """Write the amplitudes in m of a rounded triangle's partials, scaled so that its highest point is `peak_m`.

    That lies where the force pulls, within `width` about `position`; elsewhere the string is straight.
    """
    turn = len(sines)
    grid = turn // 2 + 1
    low = max(int((position - width / 2) * (grid - 1)) - 1, 1)
    high = min(int((position + width / 2) * (grid - 1)) + 2, grid - 2) + 1
    player.pulled[low:high] = 0.0
    for mode in range(1, grid - 1):
        amplitude, place = pulses.corner(mode, position, width), mode * low % turn
        for point in range(low, high):
            player.pulled[point] += amplitude * sines[place]
            place += mode
            if place >= turn:
                place -= turn
        if mode <= modes:
            player.amplitudes[mode - 1] = amplitude
    highest = max(player.pulled[low:high].max(), 0.0)  # above 0 where the force pulls; the ends are at 0
    for mode in range(modes):
        player.amplitudes[mode] *= peak_m / highest


@kernel
def release_pluck(player: Player, table: Table, string_row: np.ndarray, partials: int, release_s: float) -> None:
    """Multiply `player.amplitudes` by what a release, or a blow, of a duration leaves of each partial.

    See `engine.excitation.blow_factor`; `release_s` of 0 is at once. What touches a string leaves it within a period
    of its lowest partial. So soft strokes of high keys are heard.
    """
    release_s = min(release_s, MOST_PERIODS * 2 * math.pi / math.sqrt(strings.omega_squared(string_row, 1)))
    for mode in range(partials if table.strikes != 0 else 0):
        share = math.sqrt(strings.omega_squared(string_row, 1) / strings.omega_squared(string_row, mode + 1))
        player.amplitudes[mode] *= 2 / math.pi * share
    for mode in range(partials if release_s > 0.0 else 0):
        turns = math.sqrt(strings.omega_squared(string_row, mode + 1)) * release_s / (2 * math.pi)
        player.amplitudes[mode] *= pulses.spectrum(turns)


@kernel
def varied(stroke: int, key: int, which: int) -> float:
    """A random number in -1 … 1, the same for the same stroke and key; `which`: one of several, from 0."""
    return float(np.uint64(mixed(stroke * 4096 + key * 16 + which + 1)) >> np.uint64(12)) / 2.0**51 - 1


@kernel
def nearest(position: float, amplitude_mm: float, width: float) -> tuple[float, float, float]:
    """Position, amplitude and width of the nearest pluck within the ranges of `engine.pluck.Pluck`."""
    return (
        min(max(position, POSITION_RANGE[0]), POSITION_RANGE[1]),
        min(max(amplitude_mm, LEAST_AMPLITUDE_MM), LARGEST_AMPLITUDE_MM),
        min(max(width, WIDTH_RANGE[0]), WIDTH_RANGE[1]),
    )


@kernel
def vary(
    position: float, amplitude_mm: float, width: float, varies: float, stroke: int, key: int
) -> tuple[float, float, float]:
    """Position, amplitude and width of one stroke of a pluck, varied, within their ranges.

    `varies`: the instrument's variation, 0 … 1; `stroke` and `key` choose how.
    """
    return nearest(
        position * (1 + varies * VARIES_PLACE * varied(stroke, key, 0)),
        amplitude_mm * 10.0 ** (varies * VARIES_DB / 20 * varied(stroke, key, 1)),
        width * (1 + varies * VARIES_WIDTH * varied(stroke, key, 2)),
    )


@kernel
def split(player: Player, table: Table, string_row: np.ndarray, partials: int, turned: float) -> tuple[int, int]:
    """Split a pluck's partials, `player.amplitudes`, into modes of both polarisations, in place.

    Return how many modes these are, and how many partials have two.

    Args:
        turned: by so many rad from the instrument's angle.
    """
    if table.recorded == 0:
        pairs = _polarise(player, table, partials, turned)
        return partials + pairs, pairs
    modes = keys.modes_of(table, partials)
    recorded.split(keys.additions(table), string_row, modes, player.amplitudes[:modes])
    return modes, (modes + 1) // 2


@kernel
def _polarise(player: Player, table: Table, partials: int, turned: float) -> int:
    """Split the partials of a string that was not recorded, as `split`; return how many have two modes."""
    pairs = min(table.pairs, partials)
    if pairs == 0:
        return 0
    cosine, sine = math.cos(turned), math.sin(turned)
    normal, along = table.pulled[0], table.pulled[1]
    for mode in range(partials + pairs - 1, -1, -1):
        amplitude = player.amplitudes[strings.partial_of(mode, pairs) - 1]
        second = strings.direction_of(mode, pairs) == 1
        part = along * cosine + normal * sine if second else normal * cosine - along * sine
        if mode >= 2 * pairs:  # heard as the others are
            part = 1 / table.heard[0]
        player.amplitudes[mode] = part * amplitude
    return pairs


@kernel
def reference_share(player: Player) -> float:
    """The share, 0 … 1 from softest to hardest, of the velocity at which keys are equally loud."""
    return velocities.share(of.REFERENCE_VELOCITY, player.values[of.VALUE.pluck_curve])
