"""Channels: their wheels, pedals and footswitches, the keys that are down, and for which notes they hold.

In guitar mode the first channels are the strings, the highest first, as guitars with MIDI send them. The first of
them alone may as well be a keyboard: until another has played, it plays any key, each on the string that the key
chooses. So do all further channels, and the keys of the computer and the screen always.

A channel's own wheel and pedal hold for what was struck on it. Those of the first channel hold for the keys of the
computer and the screen too, which have none, and in MPE, as the master's, for every channel.

A release belongs to the earliest stroke of its key that has none: a key that is struck again before it was released
is held until the last of its releases.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.kernels import playing_layout as of
from engine.kernels.compiled import COMPILED
from engine.kernels.playing import slots

MPE_BEND_SEMITONES = 48.0  # range of the pitch wheel of a member channel
WIDEST_SEMITONES = 96.0  # that messages may ask for
HAMMER_S, SLIDE_S = 0.006, (0.02, 1.0)  # of the glide to the length of another key; of a slide, at times of 0 and 127
# Controllers of MIDI
DATA, FINE_DATA, INCREMENT, DECREMENT, FINE_OTHER, OTHER, FINE_REGISTERED, REGISTERED = (
    6,
    38,
    96,
    97,
    98,
    99,
    100,
    101,
)
NO_PARAMETER, BEND_RANGE, FINE_TUNING, COARSE_TUNING = 127, 0, 1, 2  # registered parameters
SWITCHES = (
    of.CHANNEL_LEGATO,
    of.CHANNEL_SLIDES,
    of.CHANNEL_HARMONICS,
    of.CHANNEL_TREMOLO,
    of.CHANNEL_STRUMS,
)


@njit(**COMPILED)
def rest(player: np.ndarray, players: np.ndarray, number: int, pedal: int, plays: int) -> None:
    """A channel as if nobody had moved anything on it, except for these."""
    channel = slots.channel(number)
    player[channel + of.CHANNEL_BEND] = 0.0
    player[channel + of.CHANNEL_RANGE] = -1.0
    players[channel + of.CHANNEL_PEDAL] = pedal
    players[channel + of.CHANNEL_SLIDE] = -1
    players[channel + of.CHANNEL_PLAYS] = plays
    players[channel + of.CHANNEL_COARSE] = NO_PARAMETER
    players[channel + of.CHANNEL_FINE] = NO_PARAMETER
    players[channel + of.CHANNEL_COARSE_TUNING] = 0
    players[channel + of.CHANNEL_FINE_TUNING] = 0


@njit(**COMPILED)
def reset(player: np.ndarray, players: np.ndarray, number: int) -> None:
    """Resets wheel, pedals, expression and the choice of a parameter, as MIDI's RP-015 has it; all else stays."""
    channel = slots.channel(number)
    player[channel + of.CHANNEL_BEND] = player[channel + of.CHANNEL_MUTE] = 0.0
    players[channel + of.CHANNEL_PEDAL] = 0
    players[channel + of.CHANNEL_COARSE] = NO_PARAMETER
    players[channel + of.CHANNEL_FINE] = NO_PARAMETER
    players[channel + of.CHANNEL_EXPRESSION] = 127
    for switch in SWITCHES:
        players[channel + switch] = 0


@njit(**COMPILED)
def begin(player: np.ndarray, players: np.ndarray, number: int) -> None:
    """Puts a channel in the state in which nobody has played on it."""
    reset(player, players, number)
    rest(player, players, number, 0, 0)
    players[slots.channel(number) + of.CHANNEL_VOLUME] = of.USUAL_VOLUME


@njit(**COMPILED)
def loudness(players: np.ndarray, mode: int, channel: int) -> float:
    """The factor of what was struck on a channel, by its volume and expression: General MIDI's squares."""
    share = 1.0
    for each in range(of.CHANNELS):
        if acts_on(mode, each, channel):
            share *= players[slots.channel(each) + of.CHANNEL_VOLUME] / of.USUAL_VOLUME
            share *= players[slots.channel(each) + of.CHANNEL_EXPRESSION] / 127
    return share * share


@njit(**COMPILED)
def loudness_db(players: np.ndarray, mode: int, channel: int) -> float:
    """The same in dB."""
    return 20 * math.log10(max(loudness(players, mode, channel), 1e-9))


@njit(**COMPILED)
def is_master(mode: int, channel: int, other: int) -> bool:
    """Whether "all notes off" and "reset all controllers" on a channel are meant for another: MPE's master's."""
    return channel == other or (mode == of.MPE and channel == of.FIRST and other != of.ON_SCREEN)


@njit(**COMPILED)
def acts_on(mode: int, channel: int, other: int) -> bool:
    """Whether wheel and pedal of a channel hold for what was struck on another."""
    return channel == other or (channel == of.FIRST and (mode == of.MPE or other == of.ON_SCREEN))


@njit(**COMPILED)
def pedal_down(players: np.ndarray, mode: int, channel: int) -> bool:
    """Whether a pedal holds what was struck on a channel."""
    for each in range(of.CHANNELS):
        if players[slots.channel(each) + of.CHANNEL_PEDAL] != 0 and acts_on(mode, each, channel):
            return True
    return False


@njit(**COMPILED)
def semitones(player: np.ndarray, players: np.ndarray, mode: int, channel: int) -> float:
    """How far pitch wheels bend what was struck on a channel, and how far it is tuned."""
    total = 0.0
    for each in range(of.CHANNELS):
        if acts_on(mode, each, channel):
            own = slots.channel(each)
            total += players[own + of.CHANNEL_COARSE_TUNING] + players[own + of.CHANNEL_FINE_TUNING] / of.TUNING_STEPS
            if player[own + of.CHANNEL_BEND] != 0.0:
                total += player[own + of.CHANNEL_BEND] * _bend_range(player, mode, each)
    return total


@njit(**COMPILED)
def _is_member(mode: int, number: int) -> bool:
    return mode == of.MPE and number != of.FIRST and number != of.ON_SCREEN


@njit(**COMPILED)
def _bend_range(player: np.ndarray, mode: int, number: int) -> float:
    """Semitones of a whole bend of a channel."""
    wide = player[slots.channel(number) + of.CHANNEL_RANGE]
    if wide >= 0.0:
        return wide
    return MPE_BEND_SEMITONES if _is_member(mode, number) else player[of.PLAYER_VALUES + of.BEND_SEMITONES]


@njit(**COMPILED)
def set_parameter(
    player: np.ndarray, players: np.ndarray, mode: int, number: int, controller: int, value: int
) -> bool:
    """Follows the controllers that choose a registered parameter and set it; whether they set one that counts here.

    Increments are of the least step, as MIDI's RP-018 has it. A member's range of bends is that of all members.
    """
    own = slots.channel(number)
    if controller in (OTHER, FINE_OTHER):
        players[own + of.CHANNEL_COARSE] = NO_PARAMETER
        players[own + of.CHANNEL_FINE] = NO_PARAMETER
    elif controller == REGISTERED:
        players[own + of.CHANNEL_COARSE] = value
    elif controller == FINE_REGISTERED:
        players[own + of.CHANNEL_FINE] = value
    if controller not in (DATA, FINE_DATA, INCREMENT, DECREMENT) or players[own + of.CHANNEL_COARSE] != 0:
        return False
    chosen, step = players[own + of.CHANNEL_FINE], 1 if controller == INCREMENT else -1
    if chosen == BEND_RANGE:
        wide = _bend_range(player, mode, number)
        if controller == DATA:
            wide = float(value)
        elif controller == FINE_DATA:
            wide = math.floor(wide) + value / 100
        else:
            wide += step / 100
        for each in range(of.CHANNELS):
            if each == number or (_is_member(mode, number) and _is_member(mode, each)):
                player[slots.channel(each) + of.CHANNEL_RANGE] = min(max(wide, 0.0), WIDEST_SEMITONES)
    elif chosen == FINE_TUNING:
        steps = players[own + of.CHANNEL_FINE_TUNING] + of.TUNING_STEPS
        if controller == DATA:
            steps = 128 * value
        elif controller == FINE_DATA:
            steps = steps // 128 * 128 + value
        else:
            steps += step
        players[own + of.CHANNEL_FINE_TUNING] = min(max(steps, 0), 2 * of.TUNING_STEPS - 1) - of.TUNING_STEPS
    elif chosen == COARSE_TUNING and controller != FINE_DATA:
        semitone = value - 64 if controller == DATA else players[own + of.CHANNEL_COARSE_TUNING] + step
        players[own + of.CHANNEL_COARSE_TUNING] = min(max(semitone, -64), 63)
    else:
        return False
    return True


@njit(**COMPILED)
def _is_string(players: np.ndarray, tables: np.ndarray, channel: int) -> bool:
    """Whether a channel is one string of a guitar. The first one is, once another string has played."""
    if tables[of.TABLE_MODE] != of.GUITAR:
        return False
    count = of.GUITAR_STRINGS
    if tables[of.TABLE_STRINGS] > 0:
        count = min(count, tables[of.TABLE_STRINGS])
    others = 0
    for each in range(of.FIRST + 1, count):
        others += players[slots.channel(each) + of.CHANNEL_PLAYS]
    return channel < count and others > 0


@njit(**COMPILED)
def place_of(players: np.ndarray, tables: np.ndarray, event: int) -> int:
    """Which string of the instrument the note of an event has; 256 (n + 1): string n of a set, which was given."""
    channel, string = players[event + of.EVENT_CHANNEL], players[event + of.EVENT_STRING]
    if _is_string(players, tables, channel):
        return 256 * (channel + 1)
    if 0 < string <= min(tables[of.TABLE_STRINGS], of.GUITAR_STRINGS):
        return 256 * string
    return (256 * (channel + 1) if tables[of.TABLE_MODE] == of.MPE else 0) + players[event + of.EVENT_KEY] + 1


@njit(**COMPILED)
def hold(players: np.ndarray, channel: int, key: int, down: bool) -> None:
    """Notes that a key is down, or is not."""
    slot = slots.channel(channel) + of.CHANNEL_HELD + key // 64
    bit = np.int64(1) << np.int64(key % 64)
    players[slot] = players[slot] | bit if down else players[slot] & ~bit


@njit(**COMPILED)
def strike(players: np.ndarray, channel: int, key: int) -> None:
    """Counts a stroke of a key."""
    players[slots.channel(channel) + of.CHANNEL_STRUCK + key] += 1


@njit(**COMPILED)
def release_latest(players: np.ndarray, channel: int, key: int) -> bool:
    """Takes a release of a key for its earliest stroke that has none; whether that is the latest."""
    slot = slots.channel(channel) + of.CHANNEL_STRUCK + key
    players[slot] = max(players[slot] - 1, 0)
    return players[slot] == 0


@njit(**COMPILED)
def is_down(players: np.ndarray, channel: int, key: int) -> bool:
    slot = slots.channel(channel) + of.CHANNEL_HELD + key // 64
    return (players[slot] >> np.int64(key % 64)) & 1 != 0


@njit(**COMPILED)
def release_key(players: np.ndarray, channel: int, key: int) -> None:
    """A key is not down, and none of its strokes awaits a release."""
    hold(players, channel, key, False)
    players[slots.channel(channel) + of.CHANNEL_STRUCK + key] = 0


@njit(**COMPILED)
def release_keys(players: np.ndarray, channel: int) -> None:
    """No key of a channel is down."""
    players[slots.channel(channel) + of.CHANNEL_HELD] = 0
    players[slots.channel(channel) + of.CHANNEL_HELD + 1] = 0
    for key in range(of.KEYS):
        players[slots.channel(channel) + of.CHANNEL_STRUCK + key] = 0


@njit(**COMPILED)
def switched(players: np.ndarray, mode: int, channel: int, which: int) -> bool:
    """Whether a footswitch, by its slot of a channel, holds for a channel."""
    down = False
    for each in range(of.CHANNELS):
        down = down or (players[slots.channel(each) + which] != 0 and acts_on(mode, each, channel))
    return down


@njit(**COMPILED)
def moves_in_s(players: np.ndarray, mode: int, channel: int) -> float:
    """The time in which a note moves to another key of its channel."""
    for each in range(of.CHANNELS):
        own = slots.channel(each)
        if players[own + of.CHANNEL_SLIDES] != 0 and acts_on(mode, each, channel):
            return SLIDE_S[0] * (SLIDE_S[1] / SLIDE_S[0]) ** (players[own + of.CHANNEL_TIME] / 127)
    return HAMMER_S
