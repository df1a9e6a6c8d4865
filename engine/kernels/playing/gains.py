"""The gains that make all keys equally loud, found from the sound of each."""

from __future__ import annotations

import math

from engine.bounds import LARGEST_AMPLITUDE_MM
from engine.kernels import constants as of
from engine.kernels import loudness, recorded, strings, velocities
from engine.kernels.compiled import kernel
from engine.kernels.playing import keys, plucks, voices
from engine.kernels.records import Player, Table
from engine.levels import FULL_SCALE_M, FULL_SCALE_M_S

LEAST_SWING_M = 1e-9


@kernel
def forget_gains(player: Player) -> None:
    """Forget the gains of all keys, so that each is computed again with the next note of its key."""
    player.limit = 0.0
    player.gains[:] = 0.0


@kernel
def _sound(player: Player, table: Table, key: int, string: int) -> int:
    """Fill the sound of a key at the reference velocity, see `loudness`, and return its modes; 0: it is silent.

    The modulation wheel and the mute do not count: what they change is heard as louder or softer.
    """
    string_row, pitch_hz = player.bent, keys.pitch_of(table, key)
    if not pitch_hz > 0.0:
        return 0
    partials, shortened = keys.string_of(player, table, key, string, pitch_hz, False, string_row)
    if partials < 1 or strings.overdamped(string_row, partials):
        return 0
    share = plucks.reference_share(player)
    values = player.values
    softest_mm, hardest_mm = values[of.VALUE.pluck_softest_mm], values[of.VALUE.pluck_hardest_mm]
    amplitude_mm = velocities.between(softest_mm, hardest_mm, share) * shortened
    for mode in range(partials):
        pulled_m = min(amplitude_mm, LARGEST_AMPLITUDE_MM) / 1000
        player.amplitudes[mode] = pulled_m * player.reference[mode]
    softest_ms, hardest_ms = values[of.VALUE.pluck_release_ms], values[of.VALUE.pluck_release_hard_ms]
    release_s = velocities.contact_s(softest_ms, hardest_ms, share)
    plucks.release_pluck(player, table, string_row, partials, release_s)
    modes, pairs = plucks.split(player, table, string_row, partials, 0.0)
    decay, inside = values[of.VALUE.knobs_decay], values[of.VALUE.knobs_brightness_decay]
    together = decay
    if table.course > 1 and not keys.has_octave(table, key, string):  # at first they are in phase
        together *= 1 + (table.course - 1) * table.bridge
    # Rows (modes,): first ω², σ, k and η²; then ω, left and right replace all of these but σ
    rows = player.sound[: of.SOUND_ROWS * modes]
    conductance = together * table.conductance[0], together * table.conductance[1]
    losses = decay * table.losses[0], inside * table.losses[1], inside * table.losses[2]
    strings.rows(string_row, modes, pairs, table.detuning, conductance, losses, rows)
    if table.recorded != 0:
        recorded.correct(keys.additions(table), string_row, modes, rows)
    for mode in range(modes):
        partial, direction = strings.partial_of(mode, pairs), strings.direction_of(mode, pairs)
        omega = math.sqrt(rows[mode])
        amplitude = player.amplitudes[mode]
        if pairs > 0 and table.recorded == 0:
            amplitude *= table.heard[direction]
        if table.velocity != 0:
            amplitude *= omega * (FULL_SCALE_M / FULL_SCALE_M_S)
        rows[of.SOUND_OMEGA * modes + mode] = omega
        rows[of.SOUND_RIGHT * modes + mode] = 0.0
        for point in range(table.points):
            place = values[of.VALUE.pickup_points_0 + point]
            weight = voices.weight_of(string_row, partial, place, table.aperture_m)
            rows[(of.SOUND_LEFT + point) * modes + mode] = amplitude * weight
    return modes


@kernel
def _look_at_peaks(player: Player, table: Table) -> None:
    """Compute the pluck with which keys are equally loud, and the factor that keeps all below the highest peak.

    They are `player.reference`, amplitudes by partial of a pluck of 1 m, and `player.limit`, from a few keys.
    """
    share = plucks.reference_share(player)
    width = velocities.between(player.values[of.VALUE.pluck_width], player.values[of.VALUE.pluck_width_hard], share)
    partials = min(player.modes - of.MOST_PAIRS, of.MOST_MODES)
    plucks.pull(player, table, table.shape, partials, player.values[of.VALUE.pluck_position], 1.0, width)
    for mode in range(partials):
        player.reference[mode] = player.amplitudes[mode]
    (body, mix), highest = keys.body_of(player, table), 0.0
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
    """The factor that makes a key as loud as others, on a string of a set or, -1, the one that the key chooses.

    Both this factor and how far that string swings, `player.swings_m`, are kept until a value changes.
    """
    if player.gains[key, 1 + string] == 0.0:
        if player.limit == 0.0:
            _look_at_peaks(player, table)
        body, mix = keys.body_of(player, table)
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
