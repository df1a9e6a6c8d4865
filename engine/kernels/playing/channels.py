"""Channels: their wheels, pedals and footswitches, the keys that are down, and for which notes they hold.

In guitar mode the first channels are the strings, the highest first, as guitars with MIDI send them. The first of
them alone may as well be a keyboard: until another has played, it plays any key, each on the string that the key
chooses. So do all further channels, and the keys of the computer and the screen always.

A channel's own wheel and pedal hold for what was struck on it. Those of the first channel hold for the keys of the
computer and the screen too, which have none; in MPE, as the master's, for every channel.

A release belongs to the earliest stroke of its key that has none: a key that is struck again before it was released
is held until the last of its releases.

Channels are numbered from 0, see `constants.CHANNELS`. `mode` is the table's: POLY, GUITAR or MPE.
"""

from __future__ import annotations

import math

from engine.kernels import constants as of
from engine.kernels import midi
from engine.kernels.compiled import kernel
from engine.kernels.records import Event, Player, Table

MPE_BEND_SEMITONES = 48.0  # range of the pitch wheel of a member channel
WIDEST_SEMITONES = 96.0  # that messages may ask for
HAMMER_S, SLIDE_S = 0.006, (0.02, 1.0)  # of the glide to the length of another key; of a slide, at times of 0 and 127


@kernel
def rest(player: Player, number: int) -> None:
    """Put a channel's wheels, tuning and choice of a parameter at rest; pedals, footswitches and volume stay."""
    channel = player.channels[number]
    channel.bend = 0.0
    channel.range_semitones = -1.0
    channel.slide = -1
    channel.coarse = midi.NO_PARAMETER
    channel.fine = midi.NO_PARAMETER
    channel.coarse_tuning = 0
    channel.fine_tuning = 0


@kernel
def reset(player: Player, number: int) -> None:
    """Reset wheel, pedals, expression and the choice of a parameter, as MIDI's RP-015 has it; all else stays."""
    channel = player.channels[number]
    channel.bend = channel.mute = 0.0
    channel.coarse = midi.NO_PARAMETER
    channel.fine = midi.NO_PARAMETER
    channel.expression = 127
    channel.switches[:] = 0


@kernel
def begin(player: Player, number: int) -> None:
    """Put a channel in the state in which nobody has played on it."""
    reset(player, number)
    rest(player, number)
    player.channels[number].plays = 0
    player.channels[number].volume = of.USUAL_VOLUME


@kernel
def loudness(player: Player, mode: int, channel: int) -> float:
    """The factor of loudness of what was struck on a channel, by volume and expression: General MIDI's squares."""
    share = 1.0
    for number in range(of.CHANNELS):
        if acts_on(mode, number, channel):
            share *= player.channels[number].volume / of.USUAL_VOLUME
            share *= player.channels[number].expression / 127
    return share * share


@kernel
def is_master(mode: int, channel: int, other: int) -> bool:
    """Return True if the channel is the other's master in MPE, or the other itself.

    "All notes off" and "reset all controllers" on the channel are then meant for the other.
    """
    return channel == other or (mode == of.MPE and channel == of.FIRST and other != of.ON_SCREEN)


@kernel
def acts_on(mode: int, channel: int, other: int) -> bool:
    """Return True if wheel and pedal of a channel hold for what was struck on another."""
    return channel == other or (channel == of.FIRST and (mode == of.MPE or other == of.ON_SCREEN))


@kernel
def semitones(player: Player, mode: int, channel: int) -> float:
    """The bend by pitch wheels of what was struck on a channel, plus its tuning, in semitones."""
    total = 0.0
    for number in range(of.CHANNELS):
        if acts_on(mode, number, channel):
            state = player.channels[number]
            total += state.coarse_tuning + state.fine_tuning / of.TUNING_STEPS
            if state.bend != 0.0:
                total += state.bend * _bend_range(player, mode, number)
    return total


@kernel
def _is_member(mode: int, number: int) -> bool:
    """Return True if a channel is a member of MPE's zone: neither its master nor the computer's keys."""
    return mode == of.MPE and number != of.FIRST and number != of.ON_SCREEN


@kernel
def _bend_range(player: Player, mode: int, number: int) -> float:
    """The semitones of a whole bend of a channel, as set on it, else MPE's for members, else the instrument's."""
    wide = player.channels[number].range_semitones
    if wide >= 0.0:
        return wide
    return MPE_BEND_SEMITONES if _is_member(mode, number) else player.values[of.VALUE.bend_semitones]


@kernel
def set_parameter(player: Player, mode: int, number: int, controller: int, value: int) -> bool:
    """Follow the controllers that choose a registered parameter and set it; return True if one that counts was set.

    These are range of bends, fine and coarse tuning. `number` is the channel's, `value` 0 … 127. Increments are of
    the least step, as MIDI's RP-018 has it. A member's range of bends is that of all members.
    """
    state = player.channels[number]
    if controller in (midi.OTHER, midi.FINE_OTHER):
        state.coarse = midi.NO_PARAMETER
        state.fine = midi.NO_PARAMETER
    elif controller == midi.REGISTERED:
        state.coarse = value
    elif controller == midi.FINE_REGISTERED:
        state.fine = value
    if controller not in (midi.VALUE, midi.FINE_VALUE, midi.INCREMENT, midi.DECREMENT) or state.coarse != 0:
        return False
    chosen, step = state.fine, 1 if controller == midi.INCREMENT else -1
    if chosen == midi.BEND_RANGE:
        wide = _bend_range(player, mode, number)
        if controller == midi.VALUE:
            wide = float(value)
        elif controller == midi.FINE_VALUE:
            wide = math.floor(wide) + value / 100
        else:
            wide += step / 100
        for member in range(of.CHANNELS):
            if member == number or (_is_member(mode, number) and _is_member(mode, member)):
                player.channels[member].range_semitones = min(max(wide, 0.0), WIDEST_SEMITONES)
    elif chosen == midi.FINE_TUNING:
        steps = state.fine_tuning + of.TUNING_STEPS
        if controller == midi.VALUE:
            steps = 128 * value
        elif controller == midi.FINE_VALUE:
            steps = steps // 128 * 128 + value
        else:
            steps += step
        state.fine_tuning = min(max(steps, 0), 2 * of.TUNING_STEPS - 1) - of.TUNING_STEPS
    elif chosen == midi.COARSE_TUNING and controller != midi.FINE_VALUE:
        semitone = value - 64 if controller == midi.VALUE else state.coarse_tuning + step
        state.coarse_tuning = min(max(semitone, -64), 63)
    else:
        return False
    return True


@kernel
def _is_string(player: Player, table: Table, channel: int) -> bool:
    """Return True if a channel is one string of a guitar. The first one is, once another string has played."""
    if table.mode != of.GUITAR:
        return False
    count = of.GUITAR_STRINGS
    if table.strings > 0:
        count = min(count, table.strings)
    others = 0
    for other in range(of.FIRST + 1, count):
        others += player.channels[other].plays
    return channel < count and others > 0


@kernel
def place_of(player: Player, table: Table, event: Event) -> int:
    """The place of an event's note: a number for the string of the instrument on which it is played.

    256 (n + 1) is string n of a set, from the highest, 0, where the channel or the event gives it. Else each key is a
    string: key + 1, in MPE plus 256 (channel + 1).
    """
    channel, string = event.channel, event.string
    if _is_string(player, table, channel):
        return 256 * (channel + 1)
    if 0 < string <= min(table.strings, of.GUITAR_STRINGS):
        return 256 * string
    return (256 * (channel + 1) if table.mode == of.MPE else 0) + event.key + 1


@kernel
def release_latest(player: Player, channel: int, key: int) -> bool:
    """Take a release of a key for its earliest stroke that has none; return True if no other awaits its release."""
    strokes = player.channels[channel].strokes
    strokes[key] = max(strokes[key] - 1, 0)
    return strokes[key] == 0


@kernel
def release_key(player: Player, channel: int, key: int) -> None:
    """Note that a key is not down, and that none of its strokes awaits a release."""
    player.channels[channel].held[key] = player.channels[channel].strokes[key] = 0


@kernel
def release_keys(player: Player, channel: int) -> None:
    """Release all keys of a channel."""
    player.channels[channel].held[:] = 0
    player.channels[channel].strokes[:] = 0


@kernel
def switched(player: Player, mode: int, channel: int, which: int) -> bool:
    """Return True if the pedal or a footswitch, by its number, holds for a channel."""
    down = False
    for number in range(of.CHANNELS):
        down = down or (player.channels[number].switches[which] != 0 and acts_on(mode, number, channel))
    return down


@kernel
def moves_in_s(player: Player, mode: int, channel: int) -> float:
    """The time in s in which a note moves to another key of its channel: by a slide where portamento is on."""
    for number in range(of.CHANNELS):
        state = player.channels[number]
        if state.switches[of.SLIDES] != 0 and acts_on(mode, number, channel):
            return SLIDE_S[0] * (SLIDE_S[1] / SLIDE_S[0]) ** (state.slide_time / 127)
    return HAMMER_S
