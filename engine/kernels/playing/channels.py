"""Channels: their wheels, pedals and footswitches, the keys that are down, and for which notes they hold.

In guitar mode the first channels are the strings, the highest first, as guitars with MIDI send them. The first of
them alone may as well be a keyboard: until another has played, it plays any key, each on the string that the key
chooses. So do all further channels, and the keys of the computer and the screen always.

A channel's own wheel and pedal hold for what was struck on it. Those of the first channel hold for the keys of the
computer and the screen too, which have none, and in MPE, as the master's, for every channel.
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
DATA, FINE_DATA, FINE_OTHER, OTHER, FINE_REGISTERED, REGISTERED = 6, 38, 98, 99, 100, 101  # controllers of MIDI
NO_PARAMETER, BEND_RANGE = 127, 0


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
def semitones(player: np.ndarray, mode: int, channel: int) -> float:
    """How far pitch wheels bend what was struck on a channel."""
    total = 0.0
    for each in range(of.CHANNELS):
        bend, wide = player[slots.channel(each) + of.CHANNEL_BEND], player[slots.channel(each) + of.CHANNEL_RANGE]
        if bend != 0.0 and acts_on(mode, each, channel):
            if wide < 0.0:
                member = mode == of.MPE and each != of.FIRST and each != of.ON_SCREEN
                wide = MPE_BEND_SEMITONES if member else player[of.PLAYER_VALUES + of.BEND_SEMITONES]
            total += bend * wide
    return total


@njit(**COMPILED)
def set_range(player: np.ndarray, players: np.ndarray, channel: int, number: int, value: int) -> bool:
    """Follows the controllers that choose a parameter and set it; whether they set the range of bends."""
    coarse, fine, wide = channel + of.CHANNEL_COARSE, channel + of.CHANNEL_FINE, channel + of.CHANNEL_RANGE
    chosen = players[coarse] == BEND_RANGE and players[fine] == BEND_RANGE
    if number in (OTHER, FINE_OTHER):
        players[coarse] = NO_PARAMETER
        players[fine] = NO_PARAMETER
    elif number == REGISTERED:
        players[coarse] = value
    elif number == FINE_REGISTERED:
        players[fine] = value
    elif chosen and number == DATA:
        player[wide] = min(float(value), WIDEST_SEMITONES)
        return True
    elif chosen and number == FINE_DATA and player[wide] >= 0.0:
        player[wide] = min(math.floor(player[wide]) + value / 100, WIDEST_SEMITONES)
        return True
    return False


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
def is_down(players: np.ndarray, channel: int, key: int) -> bool:
    slot = slots.channel(channel) + of.CHANNEL_HELD + key // 64
    return (players[slot] >> np.int64(key % 64)) & 1 != 0


@njit(**COMPILED)
def release_keys(players: np.ndarray, channel: int) -> None:
    """No key of a channel is down."""
    players[slots.channel(channel) + of.CHANNEL_HELD] = 0
    players[slots.channel(channel) + of.CHANNEL_HELD + 1] = 0


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
