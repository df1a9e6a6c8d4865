"""The string of a key, as knobs, wheels, hands and damper have changed it."""

from __future__ import annotations

import numpy as np
from numba import njit

from engine.kernels import playing_layout as of
from engine.kernels import strings
from engine.kernels.compiled import COMPILED
from engine.kernels.playing import channels, slots

USUAL_HARMONIC = 2.0  # of its footswitch where the parameter is off: an estimate, as those of other techniques


@njit(**COMPILED)
def value_of(player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, which: int) -> float:
    """One of the instrument's values, as the modulation wheel turns it."""
    value, wheel = player[of.PLAYER_VALUES + which], players[of.PLAYER_WHEEL]
    if wheel != 0 and tables[of.TABLE_WHEEL] == which:
        return value + wheel / 127 * (table[of.TABLE_WHEEL_GOAL] - value)
    return value


@njit(**COMPILED)
def mute_of(player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, channel: int) -> float:
    """How far a hand mutes what was struck on a channel, 0 … 1."""
    share = value_of(player, players, table, tables, of.MUTE)
    for each in range(of.CHANNELS):
        if channels.acts_on(tables[of.TABLE_MODE], each, channel):
            share = max(share, player[slots.channel(each) + of.CHANNEL_MUTE])
    return share


@njit(**COMPILED)
def technique_of(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    channel: int,
    which: int,
    switch: int,
    usual: float,
) -> float:
    """The value of a technique for a channel; the usual one where its footswitch is down and the value is off."""
    value, off = value_of(player, players, table, tables, which), 1.0 if which == of.HARMONIC else 0.0
    if value <= off and channels.switched(players, tables[of.TABLE_MODE], channel, switch):
        return usual
    return value


@njit(**COMPILED)
def node_of(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, channel: int, partials: int
) -> int:
    """At 1 over how much of its length a string is touched as it is plucked; 0: it is not."""
    switch = of.CHANNEL_HARMONICS
    node = round(technique_of(player, players, table, tables, channel, of.HARMONIC, switch, USUAL_HARMONIC))
    return node if 1 < node <= partials else 0


@njit(**COMPILED)
def chosen(table: np.ndarray, count: int, key: int) -> int:
    """Which string of a set, from the highest, 0, a key chooses: the highest at or below it, else the lowest."""
    for number in range(count):
        if table[of.TABLE_OPEN + number * of.OPEN_SLOTS + of.OPEN_NOTE] <= key:
            return number
    return count - 1


@njit(**COMPILED)
def string_of(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    key: int,
    number: int,
    pitch_hz: float,
    wheeled: bool,
    out: np.ndarray,
) -> tuple[int, float]:
    """The string of a key, before bends: its partials, 0 where there is none, and its share of the whole string.

    Args:
        number: on which of a set it is played, from the highest, 0; -1, or one that would have to be slackened too
            far: the one that the key itself chooses.
        wheeled: whether with the knob that the modulation wheel turns, as far as it does.
    """
    whole, knobs, count = slots.moment(player, 0), slots.moment(player, 1), tables[of.TABLE_STRINGS]
    for which in range(of.KNOBS):
        knobs[which] = player[of.PLAYER_VALUES + which]
        if wheeled:
            knobs[which] = value_of(player, players, table, tables, which)
    first = of.TABLE_OPEN
    if count > 0:
        note = table[first + number * of.OPEN_SLOTS + of.OPEN_NOTE] if 0 <= number < count else 0.0
        if not 0 <= number < count or key < note - of.MOST_SLACKENED:
            number = chosen(table, count, key)
        first += number * of.OPEN_SLOTS
    strings.turned(table[first + of.OPEN_STRING : first + of.OPEN_SLOTS], knobs, whole)
    if not strings.possible(whole):
        return 0, 1.0
    if count > 0 and key < table[first + of.OPEN_NOTE]:  # slackened
        whole[of.TENSION] = strings.bent(whole, pitch_hz / table[first + of.OPEN_HZ])
        if not strings.possible(whole):
            return 0, 1.0
    for place in range(of.STRING):
        out[place] = whole[place]
    out[of.LENGTH] = strings.fretted(whole, pitch_hz)
    if not strings.possible(out):
        return 0, 1.0
    modes = min(strings.modes_below(out, of.HIGHEST_HZ), players[of.PLAYER_MODES] - of.MOST_PAIRS)
    return modes, out[of.LENGTH] / whole[of.LENGTH]


@njit(**COMPILED)
def has_octave(table: np.ndarray, tables: np.ndarray, key: int, number: int) -> bool:
    """Whether the course of a key has octave strings, on a string of a set; -1: on the one that the key chooses."""
    count, octaves = tables[of.TABLE_STRINGS], tables[of.TABLE_OCTAVES]
    return octaves > 0 and (number if number >= 0 else chosen(table, count, key)) >= count - octaves


@njit(**COMPILED)
def pitch_of(table: np.ndarray, tables: np.ndarray, key: int) -> float:
    """Of a note; 0: its key is silent."""
    if not tables[of.TABLE_LOW] <= key <= tables[of.TABLE_HIGH]:
        return 0.0
    return table[of.TABLE_PITCHES + key]


@njit(**COMPILED)
def string_now(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, note: int, out: np.ndarray
) -> None:
    """The string of a note with the present knobs, wheels and damper; where there is none, it stays as it is."""
    key, mode = players[note + of.NOTE_KEY], tables[of.TABLE_MODE]
    pitch_hz, fits = pitch_of(table, tables, key), True
    if pitch_hz > 0.0:
        number = players[note + of.NOTE_STRING]
        wheeled = players[of.PLAYER_WHEEL] != 0 and 0 <= tables[of.TABLE_WHEEL] < of.KNOBS
        modes, _ = string_of(player, players, table, tables, key, number, pitch_hz, wheeled, out)
        if players[note + of.NOTE_OCTAVE] != 0:
            strings.thin(out, pitch_hz)
        fits = modes > 0 and (wheeled or not strings.overdamped(out, modes))
    else:
        for place in range(of.STRING):
            out[place] = player[note + of.NOTE_OWN + place]
    semitones = channels.semitones(player, players, mode, players[note + of.NOTE_CHANNEL])
    semitones += player[note + of.NOTE_TUNED] + player[note + of.NOTE_APART] + player[note + of.NOTE_VIBRATO]
    ratio = 2.0 ** (semitones / 12)
    if fits and ratio != 1.0:
        if tables[of.TABLE_BEND_BY] == of.BY_LENGTH:
            out[of.LENGTH] = strings.slid(out, ratio)
        else:
            out[of.TENSION] = strings.bent(out, ratio)
        fits = strings.possible(out)
    if fits and players[note + of.NOTE_DAMPED] != 0:
        out[of.D1] = strings.damped(out, value_of(player, players, table, tables, of.RELEASE_S))
        fits = strings.possible(out)
    if not fits:
        for place in range(of.STRING):
            out[place] = player[note + of.NOTE_STRING_NOW + place]
