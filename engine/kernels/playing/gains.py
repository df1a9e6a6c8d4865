"""The gains that make all keys equally loud, found from the sound of each."""

from __future__ import annotations

import math

import numpy as np

from engine.bounds import LARGEST_AMPLITUDE_MM
from engine.kernels import constants as of
from engine.kernels import loudness, recorded, strings, velocities
from engine.kernels.compiled import kernel
from engine.kernels.memory import behind
from engine.kernels.playing import keys, plucks, voices
from engine.kernels.records import Player, Table
from engine.levels import FULL_SCALE_M, FULL_SCALE_M_S

LEAST_SWING_M = 1e-9


@kernel
def forget_gains(player: Player) -> None:
    """Gains of keys are computed again, each with the next note of its key."""
    player.limit = 0.0
    for key in range(of.KEYS):
        for which in range(of.GAINS):
            player.gains[key, which] = 0.0


@kernel
def _sound(player: Player, table: Table, key: int, string: int) -> int:
    """Fill the sound of a key at the reference velocity, see `loudness`.

    Returns how many modes it has; 0: it is silent.

    The modulation wheel and the mute do not count: what they change is heard as louder or softer.
    """
    string_row = player.bent
    pitch_hz = keys.pitch_of(table, key)
    if not pitch_hz > 0.0:
        return 0
    partials, shortened = keys.string_of(player, table, key, string, pitch_hz, False, string_row)
    if partials < 1 or strings.overdamped(string_row, partials):
        return 0
    share = plucks.reference_share(player)
    amplitude_mm = velocities.between(player.values[of.SOFTEST_MM], player.values[of.HARDEST_MM], share) * shortened
    for mode in range(partials):
        pulled_m = min(amplitude_mm, LARGEST_AMPLITUDE_MM) / 1000
        player.amplitudes[mode] = pulled_m * player.reference[mode]
    release_s = velocities.contact_s(player.values[of.CONTACT_MS], player.values[of.CONTACT_HARD_MS], share)
    plucks.release_pluck(player, table, string_row, partials, release_s)
    modes = partials
    pairs = 0
    learned = table.recorded != 0
    if learned:
        modes = keys.modes_of(table, partials)
        pairs = (modes + 1) // 2
        recorded.split(keys.additions(table), string_row, modes, player.amplitudes[:modes])
    else:
        pairs = plucks.split(player, table, partials, 0.0)
        modes += pairs
    decay, inside = player.values[of.DECAY], player.values[of.BRIGHTNESS_DECAY]
    together = decay
    if table.course > 1 and not keys.has_octave(table, key, string):  # at first they are in phase
        together *= 1 + (table.course - 1) * table.bridge
    rows = player.sound[: of.SOUND_ROWS * modes]
    strings.rows(
        string_row,
        modes,
        pairs,
        table.detuning,
        together * table.conductance[0],
        together * table.conductance[1],
        decay * table.losses[0],
        inside * table.losses[1],
        inside * table.losses[2],
        rows,
    )
    if learned:
        recorded.correct(keys.additions(table), string_row, modes, rows)
    for mode in range(modes):
        partial, direction = strings.partial_of(mode, pairs), strings.direction_of(mode, pairs)
        omega = math.sqrt(rows[mode])
        amplitude = player.amplitudes[mode]
        if pairs > 0 and not learned:
            amplitude *= table.heard[direction]
        if table.velocity != 0:
            amplitude *= omega * (FULL_SCALE_M / FULL_SCALE_M_S)
        rows[of.SOUND_OMEGA * modes + mode] = omega
        left, right = player.values[of.POINT], player.values[of.POINT + 1]
        stereo, aperture_m = table.points == 2, table.aperture_m
        rows[of.SOUND_LEFT * modes + mode] = amplitude * voices.weight_of(string_row, partial, left, aperture_m)
        rows[of.SOUND_RIGHT * modes + mode] = (
            amplitude * voices.weight_of(string_row, partial, right, aperture_m) if stereo else 0.0
        )
    return modes


@kernel
def _body(player: Player, table: Table) -> tuple[np.ndarray, float]:
    """The curves of the body, and how much of it is heard."""
    return behind(table, table.body, of.BODY_SLOTS), player.values[of.BODY_MIX] if table.body != 0 else 0.0


@kernel
def _look_at_peaks(player: Player, table: Table) -> None:
    """The pluck of which keys are equally loud, and the factor that keeps all keys below the highest peak."""
    share = plucks.reference_share(player)
    width = velocities.between(player.values[of.WIDTH], player.values[of.WIDTH_HARD], share)
    partials = min(player.modes - of.MOST_PAIRS, of.MOST_MODES)
    plucks.pull(player, table, table.shape, partials, player.values[of.POSITION], 1.0, width)
    for mode in range(partials):
        player.reference[mode] = player.amplitudes[mode]
    (body, mix), highest = _body(player, table), 0.0
    for number in range(loudness.LOOKED_AT):
        key = loudness.looked_at(table.low, table.high, number)
        modes = _sound(player, table, key, -1)
        sound = player.sound[: of.SOUND_ROWS * modes]
        gain = loudness.gain(sound, modes, table.points, body, mix)
        swings = (table.velocity != 0) != (table.strikes != 0)
        highest = max(highest, gain * loudness.peak(sound, modes, swings, body, mix, highest / gain))
    player.limit = loudness.limit(highest)


@kernel
def gain_of(player: Player, table: Table, key: int, string: int) -> float:
    """The factor that makes a key as loud as others on a string of a set.

    -1: the string that the key chooses.

    Beside it is kept how far that string swings.
    """
    if player.gains[key, 1 + string] == 0.0:
        if player.limit == 0.0:
            _look_at_peaks(player, table)
        body, mix = _body(player, table)
        modes = _sound(player, table, key, string)
        sound = player.sound[: of.SOUND_ROWS * modes]
        gain = loudness.gain(sound, modes, table.points, body, mix)
        gain /= max(table.course, 1)  # of strings that swing together at first
        player.gains[key, 1 + string] = gain * player.limit * table.level
        swing = 0.0
        for mode in range(modes):
            swing += player.amplitudes[mode] ** 2
        player.swings_m[key, 1 + string] = max(math.sqrt(swing), LEAST_SWING_M)
    return player.gains[key, 1 + string]
