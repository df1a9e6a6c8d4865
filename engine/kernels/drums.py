"""Drums of an instrument: a blow becomes voices of the modes that the instrument's table holds for its key.

Each key's drum is a block of the table: its modes, the weights of a blow and of the listener. A voice is that of a
string in all else, and its note is one whose voices are prepared.
"""

from __future__ import annotations

import math

import numpy as np
from numba import carray, njit

from engine.kernels import layout as at
from engine.kernels import loudness
from engine.kernels import playing_layout as of
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import pointer
from engine.kernels.modes import TOO_HIGH
from engine.kernels.playing import channels
from engine.pluck import MOST_PERIODS, RUNAWAY_FACTOR

HERTZ = -0.2  # power of the speed in the time of contact, as in `engine.strike`
FIRM_S = 0.004  # in which a stick touches a skin at 1 m/s: what touches for as long has the hardness 1
MOST_HARDER = 2.0  # the hardness of any other
UNHEARD = 1e-7  # of the loudest mode, where the loudness of a key and its peak are computed


@njit(**COMPILED)
def block_of(tables: np.ndarray, key: int) -> int:
    """First slot of the drum of a key in a table of drums; 0: the key has none."""
    return tables[tables[of.TABLE_DRUMS] + key]


@njit(**COMPILED)
def _speed(table: np.ndarray, drum: int, share: float) -> float:
    """Of a mallet at a share of the velocities, in m/s."""
    soft = table[drum + of.DRUM_SOFTEST_M_S]
    return soft * (table[drum + of.DRUM_HARDEST_M_S] / soft) ** share


@njit(**COMPILED)
def _speed_of(player: np.ndarray, table: np.ndarray, drum: int, velocity: float) -> float:
    """Of a mallet at a velocity, by the instrument's curve, in m/s."""
    curve = player[of.PLAYER_VALUES + of.CURVE]
    return _speed(table, drum, min(max((velocity - 1) / 126, 0.0), 1.0) ** (4.0**-curve))


@njit(**COMPILED)
def contact_of(
    player: np.ndarray, table: np.ndarray, tables: np.ndarray, key: int, velocity: float
) -> tuple[float, float]:
    """Strength and hardness of a blow on a key's drum, for the noise of the contact; see `engine.kernels.contact`."""
    drum = block_of(tables, key)
    reference = _speed(table, drum, (of.REFERENCE_VELOCITY - 1) / 126)
    hardness = min(FIRM_S / table[drum + of.DRUM_CONTACT_S], MOST_HARDER)
    return _speed_of(player, table, drum, velocity) / reference, hardness


@njit(**COMPILED)
def _blow(
    table: np.ndarray, tables: np.ndarray, drum: int, struck: np.ndarray, speed: float, out: np.ndarray
) -> None:
    """The speeds (modes,) that a blow gives; `struck`: those that 1 N s gives. As `engine.strike.Strike.speeds`."""
    n, energy, lowest = tables[drum + of.DRUM_MODES], 0.0, table[drum + of.DRUM_HEADER]
    for mode in range(n):
        lowest = min(lowest, table[drum + of.DRUM_HEADER + mode])
    contact_s = table[drum + of.DRUM_CONTACT_S] * max(speed, 1e-3) ** HERTZ
    contact_s = min(contact_s, MOST_PERIODS * 2 * math.pi / math.sqrt(lowest))
    for mode in range(n):
        turns = math.sqrt(table[drum + of.DRUM_HEADER + mode]) * contact_s / (2 * math.pi)
        pulse = 0.5
        if turns < 1e-6:
            pulse = 1.0
        elif abs(turns - 1) > 1e-6:
            pulse = math.sin(math.pi * turns) / (math.pi * turns * (1 - turns * turns))
        out[mode] = struck[mode] * pulse
        energy += 0.5 * table[drum + of.DRUM_MASS_KG] * out[mode] ** 2
    impulse = speed / (energy + 0.5 / table[drum + of.DRUM_MALLET_KG])
    for mode in range(n):
        out[mode] *= impulse


@njit(**COMPILED)
def _struck(table: np.ndarray, drum: int, modes: int) -> np.ndarray:
    """The speeds that 1 N s gives at the drum's own place."""
    return table[drum + of.DRUM_HEADER + 4 * modes : drum + of.DRUM_HEADER + 5 * modes]


@njit(**COMPILED)
def gain_of(player: np.ndarray, table: np.ndarray, tables: np.ndarray, key: int, drum: int) -> float:
    """The factor that makes a key as loud as others, and lets it peak no higher than the highest of them may."""
    slot = of.PLAYER_GAINS + key * of.GAINS
    if player[slot] == 0.0:
        n, rows, first = tables[drum + of.DRUM_MODES], drum + of.DRUM_HEADER, of.PLAYER_SOUND
        sound = player[first : first + of.SOUND_ROWS * n]
        speeds = sound[of.SOUND_X * n : (of.SOUND_X + 1) * n]  # behind the rows below, which have no more modes
        loud = sound[of.SOUND_Y * n : (of.SOUND_Y + 1) * n]
        speed = _speed(table, drum, (of.REFERENCE_VELOCITY - 1) / 126)
        _blow(table, tables, drum, _struck(table, drum, n), speed, speeds)
        stereo, loudest, modes = tables[of.TABLE_POINTS] == 2, 0.0, 0
        for mode in range(n):
            speeds[mode] /= math.sqrt(table[rows + mode])
            weight = abs(table[rows + 5 * n + mode])
            if stereo:
                weight = max(weight, abs(table[rows + 6 * n + mode]))
            loud[mode] = weight * abs(speeds[mode])
            loudest = max(loudest, loud[mode])
        loud[0] = loud[n - 1] = loudest  # so that the peak is looked for in the same frames
        for mode in range(n):
            if loud[mode] > UNHEARD * loudest:
                modes += 1
        place = 0
        for mode in range(n):
            if loud[mode] > UNHEARD * loudest:
                sound[of.SOUND_OMEGA * modes + place] = math.sqrt(table[rows + mode])
                sound[of.SOUND_SIGMA * modes + place] = table[rows + n + mode]
                sound[of.SOUND_LEFT * modes + place] = table[rows + 5 * n + mode] * speeds[mode]
                right = table[rows + 6 * n + mode] * speeds[mode] if stereo else 0.0
                sound[of.SOUND_RIGHT * modes + place] = right
                place += 1
        curves = tables[of.TABLE_BODY]
        body = table[curves : curves + of.BODY_SLOTS]
        mix = player[of.PLAYER_VALUES + of.BODY_MIX] if curves != 0 else 0.0
        found = loudness.gain(sound, modes, tables[of.TABLE_POINTS], body, mix)
        found *= loudness.limit(found * loudness.peak(sound, modes, True, body, mix, 0.0))
        player[slot] = found * table[of.TABLE_LEVEL]
    return player[slot]


@njit(**COMPILED)
def strike(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    event: int,
    first_voice: int,
    stride: int,
) -> float:
    """Makes the voices of a note in the player's memory, a stride apart; their gain, 0: no drum."""
    key, velocity = players[event + of.EVENT_KEY], player[event + of.EVENT_VALUE]
    drum = block_of(tables, key)
    if drum == 0 or tables[drum + of.DRUM_MODES] > players[of.PLAYER_MODES]:
        return 0.0
    gain = gain_of(player, table, tables, key, drum)
    modes, elsewhere = tables[drum + of.DRUM_MODES], players[event + of.EVENT_STRUCK]
    struck = _struck(table, drum, modes)
    if elsewhere != 0 and players[event + of.EVENT_STRUCK_MODES] == modes:
        struck = carray(pointer(elsewhere), (1 << 40,), np.float64)[:modes]
    speed = _speed_of(player, table, drum, velocity)
    for source in range(tables[of.TABLE_SOURCES]):
        slot = first_voice + source * stride
        address = players[of.PLAYER_HERE] + 8 * slot
        voice = carray(pointer(address), (stride,), np.float64)
        begun = gain * player[of.PLAYER_SOURCE_GAINS + source]
        begun *= channels.loudness(players, tables[of.TABLE_MODE], players[event + of.EVENT_CHANNEL])
        _make(player, table, tables, voice, drum, struck, speed, tables[of.TABLE_KINDS + source])
        voice.view(np.int64)[at.PROGRAM] = tables[of.TABLE_PROGRAMS + source]
        voice[at.WANTED_GAIN] = voice[at.GAIN] = voice[at.GAIN_FROM] = voice[at.GAIN_TO] = begun
    return gain


@njit(**COMPILED)
def _make(
    player: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    voice: np.ndarray,
    drum: int,
    struck: np.ndarray,
    speed: float,
    kind: int,
) -> None:
    """A voice that sets out from the speeds that a blow gives its modes; `struck`: those that 1 N s gives."""
    counts, n, rate_hz = voice.view(np.int64), tables[drum + of.DRUM_MODES], player[of.PLAYER_RATE]
    used = at.FOLLOWING if kind == at.TENSION else at.TRUTH_ROWS  # what follows from them is prepared
    for slot in range(at.state(n) + used * n):
        voice[slot] = 0.0
    counts[at.KIND], counts[at.MODES], counts[at.POINTS] = kind, n, tables[of.TABLE_POINTS]
    counts[at.BEGAN_FRAME], counts[at.MOVING] = -1, n
    counts[at.FADE_FRAMES] = round(at.FADE_S * rate_hz)
    counts[at.ENDS_AT], counts[at.ENDS_IN] = round(at.LONGEST_S * rate_hz), round(at.END_FADE_S * rate_hz)
    voice[at.SILENT] = at.SILENT_DB * math.log(10.0) / 20
    rows = drum + of.DRUM_HEADER
    place = at.state(n) + at.OMEGA_SQUARED * n
    for slot in range(4 * n):
        voice[place + slot] = table[rows + slot]
    weigh(player, table, tables, voice, 0, drum)
    first, widest, loudest = at.state(n), 0.0, 0.0
    _blow(table, tables, drum, struck, speed, voice[first + n : first + 2 * n])
    for mode in range(n):
        moved, omega = voice[first + n + mode], math.sqrt(table[rows + mode])
        widest += abs(moved) / omega
        heard = 0.0
        for point in range(counts[at.POINTS]):
            heard = max(heard, abs(voice[at.weights(n, 0, point, 0) + mode]))
        loudest += heard * abs(moved) / omega
    voice[at.PEAK], voice[at.LIMIT] = max(widest, 1e-9), max(RUNAWAY_FACTOR * loudest, 1e-3)


@njit(**COMPILED)
def weigh(
    player: np.ndarray, table: np.ndarray, tables: np.ndarray, voice: np.ndarray, which: int, drum: int
) -> None:
    """Sets one of the two sets of weights of a voice; modes too high for the rate are not heard."""
    n, highest = tables[drum + of.DRUM_MODES], TOO_HIGH * player[of.PLAYER_RATE]
    rows = drum + of.DRUM_HEADER
    for point in range(tables[of.TABLE_POINTS]):
        for mode in range(n):
            heard = table[rows + mode] <= highest * highest
            first = at.weights(n, which, point, 0) + mode
            voice[first] = table[rows + (5 + point) * n + mode] if heard else 0.0
            voice[first + n] = 0.0


@njit(**COMPILED)
def hear(player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, note: int) -> None:
    """Lets a note follow the gains of sources and the places where the drum is heard."""
    drum = block_of(tables, players[note + of.NOTE_KEY])
    if drum == 0:
        return
    gain, points = player[note + of.NOTE_GAIN], of.PLAYER_VALUES + of.POINT
    gain *= channels.loudness(players, tables[of.TABLE_MODE], players[note + of.NOTE_CHANNEL])
    moved = False
    for point in range(2):
        moved = moved or player[note + of.NOTE_POINT + point] != player[points + point]
    moved = moved and players[note + of.NOTE_POINTS] == tables[of.TABLE_POINTS]
    for source in range(tables[of.TABLE_SOURCES]):
        address = players[note + of.NOTE_VOICES + source]
        if address == 0:
            continue
        voice = carray(pointer(address), (1 << 40,), np.float64)
        counts = voice.view(np.int64)
        if counts[at.MODES] != tables[drum + of.DRUM_MODES]:
            moved = False
            continue
        voice[at.WANTED_GAIN] = gain * player[of.PLAYER_SOURCE_GAINS + source]
        moved = moved and counts[at.NEXT_WEIGHTS] == 0
    if not moved:
        return
    for point in range(2):
        player[note + of.NOTE_POINT + point] = player[points + point]
    for source in range(tables[of.TABLE_SOURCES]):
        address = players[note + of.NOTE_VOICES + source]
        if address != 0:
            voice = carray(pointer(address), (1 << 40,), np.float64)
            weigh(player, table, tables, voice, 1, drum)
            voice.view(np.int64)[at.WEIGHTS_FADED] = 0
            voice.view(np.int64)[at.NEXT_WEIGHTS] = 1
