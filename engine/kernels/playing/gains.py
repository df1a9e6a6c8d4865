"""How loud a key is: the gain that makes all keys equally loud, found from the sound of each."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.kernels import loudness, recorded, strings
from engine.kernels import playing_layout as of
from engine.kernels.compiled import COMPILED
from engine.kernels.playing import keys, plucks, slots, voices
from engine.pluck import FULL_SCALE_M, FULL_SCALE_M_S, LARGEST_AMPLITUDE_MM

LEAST_SWING_M = 1e-9


@njit(**COMPILED)
def forget_gains(player: np.ndarray) -> None:
    """Gains of keys are computed again, each with the next note of its key."""
    player[of.PLAYER_LIMIT] = 0.0
    for slot in range(of.KEYS * of.GAINS):
        player[of.PLAYER_GAINS + slot] = 0.0


@njit(**COMPILED)
def swing_slot(key: int, string: int) -> int:
    """Where `gain_of` keeps how far a key's string swings at the reference velocity."""
    return of.PLAYER_SWINGS_M + key * of.GAINS + 1 + string


@njit(**COMPILED)
def _sound(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, key: int, string: int
) -> int:
    """Fills the sound of a key at the reference velocity, see `loudness`; how many modes it has, 0: it is silent.

    The modulation wheel and the mute do not count: what they change is heard as louder or softer.
    """
    own, values, first = slots.moment(player, 2), of.PLAYER_VALUES, of.PLAYER_SOUND
    pitch_hz = keys.pitch_of(table, tables, key)
    if not pitch_hz > 0.0:
        return 0
    partials, shortened = keys.string_of(player, players, table, tables, key, string, pitch_hz, False, own)
    if partials < 1 or strings.overdamped(own, partials):
        return 0
    share, soft = plucks.reference_share(player), player[values + of.SOFTEST_MM]
    amplitude_mm = soft * (player[values + of.HARDEST_MM] / soft) ** share * shortened
    for mode in range(partials):
        pulled_m = min(amplitude_mm, LARGEST_AMPLITUDE_MM) / 1000
        player[of.PLAYER_AMPLITUDES + mode] = pulled_m * player[of.PLAYER_REFERENCE + mode]
    release_s = plucks.contact_s(player[values + of.CONTACT_MS], player[values + of.CONTACT_HARD_MS], share)
    plucks.release_pluck(player, tables, own, partials, release_s)
    modes, pairs, learned = partials, 0, tables[of.TABLE_RECORDED] != 0
    if learned:
        modes = recorded.modes_of(tables, partials)
        pairs = (modes + 1) // 2
        recorded.split(table, tables, own, modes, player[of.PLAYER_AMPLITUDES : of.PLAYER_AMPLITUDES + modes])
    else:
        pairs = plucks.split(player, table, tables, partials, 0.0)
        modes += pairs
    decay, inside = player[values + of.DECAY], player[values + of.BRIGHTNESS_DECAY]
    together = decay
    if tables[of.TABLE_COURSE] > 1 and not keys.has_octave(table, tables, key, string):  # at first they are in phase
        together *= 1 + (tables[of.TABLE_COURSE] - 1) * table[of.TABLE_BRIDGE]
    rows = player[first : first + 4 * modes]
    strings.rows(
        own,
        modes,
        pairs,
        table[of.TABLE_DETUNING],
        together * table[of.TABLE_CONDUCTANCE],
        together * table[of.TABLE_CONDUCTANCE + 1],
        decay * table[of.TABLE_LOSSES],
        inside * table[of.TABLE_LOSSES + 1],
        inside * table[of.TABLE_LOSSES + 2],
        rows,
    )
    if learned:
        recorded.correct(table, tables, own, modes, rows)
    for mode in range(modes):
        partial, direction = strings.partial_of(mode, pairs), strings.direction_of(mode, pairs)
        omega = math.sqrt(rows[mode])
        amplitude = player[of.PLAYER_AMPLITUDES + mode]
        if pairs > 0 and not learned:
            amplitude *= table[of.TABLE_HEARD + direction]
        if tables[of.TABLE_VELOCITY] != 0:
            amplitude *= omega * (FULL_SCALE_M / FULL_SCALE_M_S)
        rows[of.SOUND_OMEGA * modes + mode] = omega
        left, right = player[values + of.POINT], player[values + of.POINT + 1]
        stereo, aperture_m = tables[of.TABLE_POINTS] == 2, table[of.TABLE_APERTURE_M]
        rows[of.SOUND_LEFT * modes + mode] = amplitude * voices.weight_of(own, partial, left, aperture_m)
        rows[of.SOUND_RIGHT * modes + mode] = (
            amplitude * voices.weight_of(own, partial, right, aperture_m) if stereo else 0.0
        )
    return modes


@njit(**COMPILED)
def _body(player: np.ndarray, table: np.ndarray, tables: np.ndarray) -> tuple[np.ndarray, float]:
    """The curves of the body, and how much of it is heard."""
    slot = tables[of.TABLE_BODY]
    return table[slot : slot + of.BODY_SLOTS], player[of.PLAYER_VALUES + of.BODY_MIX] if slot != 0 else 0.0


@njit(**COMPILED)
def _look_at_peaks(player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray) -> None:
    """The pluck of which keys are equally loud, and the factor that keeps all keys below the highest peak."""
    values, share = of.PLAYER_VALUES, plucks.reference_share(player)
    width = player[values + of.WIDTH]
    width *= (player[values + of.WIDTH_HARD] / width) ** share
    partials = min(players[of.PLAYER_MODES] - of.MOST_PAIRS, of.MOST_MODES)
    plucks.pull(player, table, tables, tables[of.TABLE_SHAPE], partials, player[values + of.POSITION], 1.0, width)
    for mode in range(partials):
        player[of.PLAYER_REFERENCE + mode] = player[of.PLAYER_AMPLITUDES + mode]
    (body, mix), highest = _body(player, table, tables), 0.0
    for number in range(loudness.LOOKED_AT):
        key = loudness.looked_at(tables[of.TABLE_LOW], tables[of.TABLE_HIGH], number)
        modes = _sound(player, players, table, tables, key, -1)
        sound = player[of.PLAYER_SOUND : of.PLAYER_SOUND + of.SOUND_ROWS * modes]
        gain = loudness.gain(sound, modes, tables[of.TABLE_POINTS], body, mix)
        swings = (tables[of.TABLE_VELOCITY] != 0) != (tables[of.TABLE_STRIKES] != 0)
        highest = max(highest, gain * loudness.peak(sound, modes, swings, body, mix, highest / gain))
    player[of.PLAYER_LIMIT] = loudness.limit(highest)


@njit(**COMPILED)
def gain_of(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, key: int, string: int
) -> float:
    """The factor that makes a key as loud as others on a string of a set, -1: the one that it chooses.

    Beside it is kept how far that string swings.
    """
    slot = of.PLAYER_GAINS + key * of.GAINS + 1 + string
    if player[slot] == 0.0:
        if player[of.PLAYER_LIMIT] == 0.0:
            _look_at_peaks(player, players, table, tables)
        body, mix = _body(player, table, tables)
        modes = _sound(player, players, table, tables, key, string)
        sound = player[of.PLAYER_SOUND : of.PLAYER_SOUND + of.SOUND_ROWS * modes]
        found = loudness.gain(sound, modes, tables[of.TABLE_POINTS], body, mix)
        found /= max(tables[of.TABLE_COURSE], 1)  # of strings that swing together at first
        player[slot] = found * player[of.PLAYER_LIMIT] * table[of.TABLE_LEVEL]
        swing = 0.0
        for mode in range(modes):
            swing += player[of.PLAYER_AMPLITUDES + mode] ** 2
        player[swing_slot(key, string)] = max(math.sqrt(swing), LEAST_SWING_M)
    return player[slot]
