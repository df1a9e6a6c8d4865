"""Drums of an instrument: a blow becomes voices of the modes that the instrument's table holds for its key.

Each key's drum is a block of the table: its modes, the weights of a blow and of the listener. A voice is that of a
string in all else, and its note is one whose voices are prepared.
"""

from __future__ import annotations

import math

import numpy as np

from engine.kernels import constants as of
from engine.kernels import drum_modes, loudness, velocities
from engine.kernels import voice_records as at
from engine.kernels.compiled import kernel
from engine.kernels.memory import address_of, drum_at, reals, shaped, wholes
from engine.kernels.modes import TOO_HIGH, row, weights
from engine.kernels.playing import keys, slots
from engine.kernels.records import DRUM, DRUM_ROWS, Drum, Event, Note, Player, Table
from engine.levels import RUNAWAY_FACTOR

FIRM_S = 0.004  # in which a stick touches a skin at 1 m/s: what touches for as long has the hardness 1
MOST_HARDER = 2.0  # the hardness of any other
HEADER = DRUM.itemsize // 8
SQUARE, SIGMA, _COUPLING, _STRETCH, STRUCK, WEIGHTS = range(6)  # rows of a drum
UNHEARD = 1e-7  # of the loudest mode, where the loudness of a key and its peak are computed


@kernel
def has_modes(table: Table, key: int, modes: int) -> bool:
    """Return True if a key has a drum of so many modes."""
    return has_drum(table, key) and drum_of(table, key).modes == modes


@kernel
def has_drum(table: Table, key: int) -> bool:
    """Return True if a table of drums has one for a key."""
    return wholes(address_of(table))[table.drums + key] != 0


@kernel
def drum_of(table: Table, key: int) -> Drum:
    """The drum of a key that has one."""
    address = address_of(table)
    return drum_at(address + 8 * wholes(address)[table.drums + key])


@kernel
def rows_of(drum: Drum) -> np.ndarray:
    """The rows (DRUM_ROWS, modes) of a drum."""
    return shaped(reals(address_of(drum)), HEADER, (DRUM_ROWS, drum.modes))


@kernel
def _speed(drum: Drum, share: float) -> float:
    """The speed of a mallet at a share of the velocities, in m/s."""
    return velocities.between(drum.softest_m_s, drum.hardest_m_s, share)


@kernel
def _speed_of(player: Player, drum: Drum, velocity: float) -> float:
    """The speed of a mallet at a velocity, by the instrument's curve, in m/s."""
    return _speed(drum, velocities.share(velocity, player.values[of.VALUE.pluck_curve]))


@kernel
def _blow(drum: Drum, struck: np.ndarray, speed: float, out: np.ndarray) -> None:
    """Write the speeds (modes,) that a mallet's blow of a speed in m/s gives; `struck`: those that 1 N s gives."""
    masses_kg = drum.mass_kg, drum.mallet_kg
    drum_modes.blow(rows_of(drum)[SQUARE], struck, drum.contact_s, masses_kg, speed, out[: drum.modes])


@kernel
def gain_of(player: Player, table: Table, key: int) -> float:
    """The factor that makes a key as loud as others, and lets it peak no higher than the highest of them may."""
    if player.gains[key, 0] == 0.0:
        drum = drum_of(table, key)
        n, rows = drum.modes, rows_of(drum)
        sound = player.sound[: of.SOUND_ROWS * n]
        speeds = sound[of.SOUND_X * n : (of.SOUND_X + 1) * n]  # behind the rows below, which have no more modes
        loud = sound[of.SOUND_Y * n : (of.SOUND_Y + 1) * n]
        _blow(drum, rows[STRUCK], _speed(drum, velocities.share(of.REFERENCE_VELOCITY, 0.0)), speeds)
        loudest = 0.0
        modes = 0
        place = 0
        for mode in range(n):
            speeds[mode] /= math.sqrt(rows[SQUARE, mode])
            loud[mode] = 0.0
            for point in range(table.points):
                loud[mode] = max(loud[mode], abs(rows[WEIGHTS + point, mode] * speeds[mode]))
            loudest = max(loudest, loud[mode])
        loud[0] = loud[n - 1] = loudest  # so that the peak is looked for in the same frames
        for mode in range(n):
            modes += loud[mode] > UNHEARD * loudest
        for mode in range(n):
            if loud[mode] > UNHEARD * loudest:
                sound[of.SOUND_OMEGA * modes + place] = math.sqrt(rows[SQUARE, mode])
                sound[of.SOUND_SIGMA * modes + place] = rows[SIGMA, mode]
                sound[of.SOUND_RIGHT * modes + place] = 0.0
                for point in range(table.points):
                    sound[(of.SOUND_LEFT + point) * modes + place] = rows[WEIGHTS + point, mode] * speeds[mode]
                place += 1
        body, mix = keys.body_of(player, table)
        gain = loudness.gain(sound, modes, table.points, body, mix)
        gain *= loudness.limit(gain * loudness.peak(sound, modes, True, body, mix, 0.0))
        player.gains[key, 0] = gain * table.level
    return player.gains[key, 0]


@kernel
def take(player: Player, table: Table, note: Note) -> bool:
    """Mark a note as a drum's; set its gain, and the strength and hardness that its stroke's noise has.

    The strength is the mallet's speed over that at REFERENCE_VELOCITY with an even curve, as in `gain_of`. Returns
    False where the key has no drum; one with more modes than the player's voices hold counts as none.
    """
    note.drum = 1
    if not has_drum(table, note.key) or drum_of(table, note.key).modes > player.modes:
        return False
    note.gain = gain_of(player, table, note.key)
    drum = drum_of(table, note.key)
    reference = _speed(drum, velocities.share(of.REFERENCE_VELOCITY, 0.0))
    note.strength = _speed_of(player, drum, note.velocity) / reference
    note.hardness = min(FIRM_S / drum.contact_s, MOST_HARDER)
    return True


@kernel
def make_voice(player: Player, table: Table, address: int, event: Event, source: int) -> None:
    """Make a source's voice at an address, which sets out with the speeds that a blow gives a key's drum."""
    drum = drum_of(table, event.key)
    source_rows = rows_of(drum)
    struck = source_rows[STRUCK]
    if event.struck != 0 and event.struck_modes == drum.modes:
        struck = reals(event.struck)[: drum.modes]
    # What follows from the modes is prepared
    used = at.FOLLOWING if table.kinds[source] == at.TENSION else at.TRUTH_ROWS
    voice = slots.blank_voice(player, table, address, source, drum.modes, used)
    for which in range(STRUCK):
        row(voice, at.OMEGA_SQUARED + which)[:] = source_rows[which]
    weigh(player, table, voice, 0, event.key)
    speeds = row(voice, 1)
    _blow(drum, struck, _speed_of(player, drum, event.value), speeds)
    widest, loudest = 0.0, 0.0
    for mode in range(drum.modes):
        moved = abs(speeds[mode]) / math.sqrt(source_rows[SQUARE, mode])
        widest += moved
        weight = 0.0
        for point in range(voice.points):
            weight = max(weight, abs(weights(voice, 0, point, 0)[mode]))
        loudest += weight * moved
    voice.peak, voice.limit = max(widest, 1e-9), max(RUNAWAY_FACTOR * loudest, 1e-3)


@kernel
def weigh(player: Player, table: Table, voice: at.Voice, which: int, key: int) -> None:
    """Set one of the two sets of weights of a voice, 0 or 1, to its key's drum; modes too high are not heard."""
    highest, source_rows = TOO_HIGH * player.rate_hz, rows_of(drum_of(table, key))
    for point in range(table.points):
        real, imaginary = weights(voice, which, point, 0), weights(voice, which, point, 1)
        for mode in range(voice.modes):
            audible = source_rows[SQUARE, mode] <= highest * highest
            real[mode] = source_rows[WEIGHTS + point, mode] if audible else 0.0
            imaginary[mode] = 0.0
