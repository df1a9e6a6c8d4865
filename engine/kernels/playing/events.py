"""Events become voices, and change those that ring: the control logic of playing, without Python or allocation.

Events wait in a ring until the mixer's next quantum, and in a queue until the quantum of their frame. A note begins
at its very frame; all else counts within a quantum after it. The parts are in this folder, each of which uses those
before it: slots, channels, keys, plucks, voices, gains, changes, notes, hands, chords, controllers, events.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from engine.kernels import drums
from engine.kernels import layout as at
from engine.kernels import playing_layout as of
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import fence, reals, wholes
from engine.kernels.playing import changes, channels, chords, controllers, gains, hands, notes, slots, voices


@njit(**COMPILED)
def _take_table(player: np.ndarray, players: np.ndarray, address: int, frame: int, now: int) -> None:
    """Plays another instrument, or the same with a knob turned; strings that ring glide to it.

    Another instrument begins with its wheels at rest, for what they turned may be something else now; pedals stay.
    """
    table, tables, before = reals(address), wholes(address), players[of.PLAYER_TABLE]
    for which in range(of.VALUES):
        player[of.PLAYER_VALUES + which] = table[of.TABLE_VALUES + which]
    players[of.PLAYER_TABLE] = address
    gains.forget_gains(player)
    if before != 0 and wholes(before)[of.TABLE_INSTRUMENT] != tables[of.TABLE_INSTRUMENT]:
        players[of.PLAYER_WHEEL] = 0
        for each in range(of.CHANNELS):
            own = slots.channel(each)
            channels.rest(player, players, each, players[own + of.CHANNEL_PEDAL], players[own + of.CHANNEL_PLAYS])
    changes.glide(player, players, table, tables, -1, controllers.KNOB_S, frame, now)
    fence()
    players[of.PLAYER_SERIAL] = tables[of.TABLE_SERIAL]  # those before may be freed from here on


@njit(**COMPILED)
def _cancel(player: np.ndarray, players: np.ndarray, id: int, now: int) -> None:
    """Forgets the events whose frames are to come; but a table counts at once, for later events go by it.

    Args:
        id: of a note, of which alone events are forgotten; 0: all are.
    """
    kept = 0
    for place in range(players[of.PLAYER_QUEUED]):
        event = of.PLAYER_QUEUE + place * of.EVENT_SLOTS
        if id != 0 and players[event + of.EVENT_ID] != id:
            for each in range(of.EVENT_SLOTS):
                players[of.PLAYER_QUEUE + kept * of.EVENT_SLOTS + each] = players[event + each]
            kept += 1
        elif players[event + of.EVENT_KIND] == of.NOTE_ON:
            notes.refuse(player, players, event)
        elif players[event + of.EVENT_KIND] == of.TABLE:
            _take_table(player, players, players[event + of.EVENT_TABLE], 0, now)
    players[of.PLAYER_QUEUED] = kept


@njit(**COMPILED)
def _handle(player: np.ndarray, players: np.ndarray, mixers: np.ndarray, event: int) -> None:
    """Plays an event now. Those of a player without a table do nothing, except for a note, which is refused."""
    kind, frame, now = players[event + of.EVENT_KIND], players[event + of.EVENT_FRAME], mixers[at.M_FRAMES]
    channel, key = players[event + of.EVENT_CHANNEL], players[event + of.EVENT_KEY]
    value, address = player[event + of.EVENT_VALUE], players[of.PLAYER_TABLE]
    if kind == of.TABLE:
        _take_table(player, players, players[event + of.EVENT_TABLE], frame, now)
        return
    if kind == of.CANCEL:
        _cancel(player, players, players[event + of.EVENT_ID], now)
        return
    if kind == of.STOP:
        controllers.stop(player, players, value, frame)
        return
    if kind in (of.CHOKE, of.TUNE) and chords.waits(players, event, now):
        return
    if kind == of.CHOKE:
        hands.choke(player, players, event, frame)
        return
    if kind == of.TUNE and address != 0:
        hands.tune(player, players, reals(address), wholes(address), event, frame, now)
        return
    if not (0 <= channel < of.CHANNELS and 0 <= key < of.KEYS and address != 0):
        if kind == of.NOTE_ON:
            notes.refuse(player, players, event)
        return
    table, tables = reals(address), wholes(address)
    if kind == of.NOTE_ON and value > 0.0:
        if chords.strum(player, players, table, tables, event, now):
            return
        if player[event + of.EVENT_POSITION] > 0.0:  # by hand: no key is down
            notes.strike(player, players, table, tables, mixers, event)
            return
        channels.hold(players, channel, key, True)
        if players[event + of.EVENT_STRING] == 0:
            channels.strike(players, channel, key)
        if tables[of.TABLE_DRUMS] == 0 and hands.hammer_on(player, players, table, tables, event, frame, now):
            return
        if tables[of.TABLE_DRUMS] != 0:
            number = notes.free_note(player, players, mixers)
            first = voices.slots_of_voice(players, number, 0)
            stride = voices.slots_of_voice(players, number, 1) - first
            gain = drums.strike(player, players, table, tables, event, first, stride)
            if gain == 0.0:
                notes.refuse(player, players, event)
                return
            notes.note_on(player, players, table, tables, mixers, event, 0)
            player[slots.note(number) + of.NOTE_GAIN] = gain
            return
        notes.strike(player, players, table, tables, mixers, event)
    elif kind in (of.NOTE_ON, of.NOTE_OFF):
        if chords.waits(players, event, now):
            return
        if players[event + of.EVENT_STRING] == 0 and not channels.release_latest(players, channel, key):
            return
        channels.hold(players, channel, key, False)
        hands.note_off(player, players, table, tables, event, frame, now)
    elif kind == of.BEND:
        player[slots.channel(channel) + of.CHANNEL_BEND] = min(max(value, -1.0), 1.0)
        changes.glide(player, players, table, tables, channel, hands.BEND_S, frame, now)
    elif kind == of.CONTROLLER:
        controllers.controller(player, players, table, tables, channel, key, int(value), frame, now)
    elif kind == of.PARAMETER and key < of.VALUES:
        player[of.PLAYER_VALUES + key] = value
        if key <= of.CURVE or key >= of.BODY_MIX:
            gains.forget_gains(player)
        changes.glide(player, players, table, tables, -1, controllers.KNOB_S, frame, now)


@njit(**COMPILED)
def _superseded(players: np.ndarray, event: int, following: int) -> bool:
    """Whether an event moves a wheel, and the one that follows it at once moves the same: a burst costs one glide."""
    kind, key = players[event + of.EVENT_KIND], players[event + of.EVENT_KEY]
    same = kind == players[following + of.EVENT_KIND] and key == players[following + of.EVENT_KEY]
    if not same or players[event + of.EVENT_CHANNEL] != players[following + of.EVENT_CHANNEL]:
        return False
    return kind == of.BEND or (kind == of.CONTROLLER and key == controllers.MOD_WHEEL)


@njit(**COMPILED)
def play(player_address: int, mixer_address: int) -> None:
    """Plays all events that are due in the mixer's next quantum, before it is rendered."""
    player, players, mixers = reals(player_address), wholes(player_address), wholes(mixer_address)
    now, pushed = mixers[at.M_FRAMES], players[of.PLAYER_PUSHED]
    fence()
    notes.tend(player, players, now)
    while players[of.PLAYER_TAKEN] < pushed:
        taken = players[of.PLAYER_TAKEN]
        event = of.PLAYER_EVENTS + taken % of.EVENTS * of.EVENT_SLOTS
        following = of.PLAYER_EVENTS + (taken + 1) % of.EVENTS * of.EVENT_SLOTS
        at_once = taken + 1 < pushed and players[following + of.EVENT_FRAME] <= now
        if at_once and players[event + of.EVENT_FRAME] <= now and _superseded(players, event, following):
            pass
        elif players[event + of.EVENT_FRAME] <= now or players[event + of.EVENT_KIND] == of.CANCEL:
            chords.arrange(player, players, now, of.PLAYER_EVENTS, of.EVENTS, taken, pushed)
            _handle(player, players, mixers, event)
        elif players[of.PLAYER_QUEUED] < of.QUEUED:
            chords.queue(players, event)
        else:
            break
        fence()
        players[of.PLAYER_TAKEN] += 1
    done = 0
    while done < players[of.PLAYER_QUEUED]:
        event = of.PLAYER_QUEUE + done * of.EVENT_SLOTS
        if players[event + of.EVENT_FRAME] >= now + at.QUANTUM:
            break
        done += 1
        following = event + of.EVENT_SLOTS
        frame = players[event + of.EVENT_FRAME]
        together = done < players[of.PLAYER_QUEUED] and players[following + of.EVENT_FRAME] == frame
        if not (together and _superseded(players, event, following)):
            chords.arrange(player, players, now, of.PLAYER_QUEUE, of.QUEUED, done - 1, players[of.PLAYER_QUEUED])
            _handle(player, players, mixers, event)
    if done > 0:
        players[of.PLAYER_QUEUED] -= done
        for each in range(players[of.PLAYER_QUEUED] * of.EVENT_SLOTS):
            players[of.PLAYER_QUEUE + each] = players[of.PLAYER_QUEUE + done * of.EVENT_SLOTS + each]
    hands.follow_hands(player, players, mixers, now)
    voices.hear(player, players)


@njit(**COMPILED)
def begin(player_address: int) -> None:
    """Puts all wheels and pedals of a new player at rest."""
    player, players = reals(player_address), wholes(player_address)
    players[of.PLAYER_HERE] = player_address
    for each in range(of.CHANNELS):
        channels.begin(player, players, each)
