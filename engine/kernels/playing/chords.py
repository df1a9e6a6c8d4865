"""Events that wait for their frames, and strums: notes within some milliseconds are one chord.

Its first note begins at once, the others wait their turns in the queue.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from engine.kernels import playing_layout as of
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import reals, wholes
from engine.kernels.playing import channels, keys, notes, slots

CHORD_S = 0.03  # in which notes come that are one chord: an estimate
USUAL_STRUM_MS = 12.0  # of its footswitch


@njit(**COMPILED)
def _height(players: np.ndarray, tables: np.ndarray, event: int) -> int:
    """Rises from the lowest note of a chord to the highest: by strings where these are given, else by keys."""
    place = channels.place_of(players, tables, event)
    string = of.CHANNELS + 1 - place // 256 if place % 256 == 0 else 0
    return string * of.KEYS + players[event + of.EVENT_KEY]


@njit(**COMPILED)
def _strums_in(player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, event: int) -> int:
    """Frames from string to string of a chord that the note of an event is in; 0: notes begin as they come."""
    note_on = players[event + of.EVENT_KIND] == of.NOTE_ON and player[event + of.EVENT_VALUE] > 0.0
    channel = players[event + of.EVENT_CHANNEL]
    by_hand = player[event + of.EVENT_POSITION] > 0.0
    if not note_on or by_hand or not 0 <= channel < of.CHANNELS or tables[of.TABLE_DRUMS] != 0:
        return 0
    switch = of.CHANNEL_STRUMS
    milliseconds = keys.technique_of(player, players, table, tables, channel, of.STRUM_MS, switch, USUAL_STRUM_MS)
    return slots.frames(player, milliseconds / 1000) if milliseconds > 0.0 else 0


@njit(**COMPILED)
def _continues(player: np.ndarray, players: np.ndarray, frame: int) -> bool:
    """Whether a note that comes at a frame belongs to the latest chord."""
    since = frame - players[of.PLAYER_CHORD_BEGAN]
    return players[of.PLAYER_CHORD] != 0 and 0 <= since <= slots.frames(player, CHORD_S)


@njit(**COMPILED)
def _goes_up(player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray) -> bool:
    """Whether the next strum goes from the highest note to the lowest."""
    strokes = round(keys.value_of(player, players, table, tables, of.STROKES))
    return strokes == of.UP or (strokes == of.ALTERNATE and players[of.PLAYER_NEXT_UP] != 0)


@njit(**COMPILED)
def _swap(players: np.ndarray, first: int, second: int) -> None:
    """Exchanges two events; each place keeps its frame."""
    for slot in range(of.EVENT_SLOTS):
        if slot != of.EVENT_FRAME:
            kept = players[first + slot]
            players[first + slot] = players[second + slot]
            players[second + slot] = kept


@njit(**COMPILED)
def arrange(player: np.ndarray, players: np.ndarray, now: int, first: int, count: int, place: int, end: int) -> None:
    """Lets the first string of a chord come first, of notes that come at the same frame.

    Args:
        first, count: slot and number of the events of a ring, of which `place` is played next, and `end` is the last
            one's successor.
    """
    address, event = players[of.PLAYER_TABLE], first + place % count * of.EVENT_SLOTS
    if address == 0 or players[event + of.EVENT_CHORD] != 0:
        return
    table, tables, frame = reals(address), wholes(address), max(players[event + of.EVENT_FRAME], now)
    if _strums_in(player, players, table, tables, event) == 0 or _continues(player, players, frame):
        return
    up, best = _goes_up(player, players, table, tables), event
    for each in range(place + 1, end):
        other = first + each % count * of.EVENT_SLOTS
        together = max(players[other + of.EVENT_FRAME], now) == frame and players[other + of.EVENT_CHORD] == 0
        if not together or _strums_in(player, players, table, tables, other) == 0:
            break
        higher = _height(players, tables, other) > _height(players, tables, best)
        if higher == up:
            best = other
    _swap(players, event, best)


@njit(**COMPILED)
def strum(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, event: int, now: int
) -> bool:
    """Lets a note wait for its turn in a chord; False: it begins now."""
    chord = players[of.PLAYER_CHORD]
    if players[event + of.EVENT_CHORD] != 0:  # its turn has come
        players[of.PLAYER_CHORD_BEGUN] += players[event + of.EVENT_CHORD] == chord
        players[event + of.EVENT_CHORD] = 0
        return False
    step, frame = _strums_in(player, players, table, tables, event), max(players[event + of.EVENT_FRAME], now)
    if step == 0:
        return False
    if not _continues(player, players, frame):
        players[of.PLAYER_CHORD] += 1
        players[of.PLAYER_CHORD_BEGAN] = frame
        players[of.PLAYER_CHORD_BEGUN] = 1
        players[of.PLAYER_CHORD_UP] = _goes_up(player, players, table, tables)
        return False
    if players[of.PLAYER_QUEUED] == of.QUEUED:
        return False
    players[of.PLAYER_NEXT_UP] = 1 - players[of.PLAYER_CHORD_UP]
    turn = players[of.PLAYER_CHORD_BEGUN]
    for place in range(players[of.PLAYER_QUEUED]):
        turn += players[of.PLAYER_QUEUE + place * of.EVENT_SLOTS + of.EVENT_CHORD] == chord
    players[event + of.EVENT_CHORD], players[event + of.EVENT_CAME] = chord, frame
    players[event + of.EVENT_FRAME] = max(players[of.PLAYER_CHORD_BEGAN] + turn * step, frame)
    player[event + of.EVENT_STRUCK_S] = 0.0  # its latency is meant
    queue(players, event)
    players[event + of.EVENT_CHORD] = 0
    later, up = 0, players[of.PLAYER_CHORD_UP] != 0
    for place in range(players[of.PLAYER_QUEUED] - 1, -1, -1):  # from the new one, which is the last, to its turn
        each = of.PLAYER_QUEUE + place * of.EVENT_SLOTS
        if players[each + of.EVENT_CHORD] != chord:
            continue
        if later != 0:
            if (_height(players, tables, each) < _height(players, tables, later)) != up:
                break
            _swap(players, each, later)
        later = each
    return True


@njit(**COMPILED)
def waits(players: np.ndarray, event: int, now: int) -> bool:
    """Puts what is meant for a note behind it where that waits for its turn in a chord; whether it does."""
    id, channel, key = players[event + of.EVENT_ID], players[event + of.EVENT_CHANNEL], players[event + of.EVENT_KEY]
    by_id = id != 0 and players[event + of.EVENT_KIND] in (of.TUNE, of.CHOKE)
    for place in range(players[of.PLAYER_QUEUED]):
        each = of.PLAYER_QUEUE + place * of.EVENT_SLOTS
        if players[each + of.EVENT_CHORD] == 0:
            continue
        meant = players[each + of.EVENT_CHANNEL] == channel and players[each + of.EVENT_KEY] == key
        meant = meant and players[event + of.EVENT_STRING] in (0, players[each + of.EVENT_STRING])
        if by_id:
            meant = players[each + of.EVENT_ID] == id
        if meant and players[of.PLAYER_QUEUED] < of.QUEUED:
            later = players[each + of.EVENT_FRAME] - players[each + of.EVENT_CAME]
            players[event + of.EVENT_FRAME] = max(players[event + of.EVENT_FRAME], now) + later
            queue(players, event)
            return True
    return False


@njit(**COMPILED)
def forget_turns(player: np.ndarray, players: np.ndarray, mode: int, channel: int) -> None:
    """Forgets notes that wait for their turns in a chord: those of a channel, or all, -1."""
    for place in range(players[of.PLAYER_QUEUED]):
        event = of.PLAYER_QUEUE + place * of.EVENT_SLOTS
        meant = channel < 0 or channels.is_master(mode, channel, players[event + of.EVENT_CHANNEL])
        if players[event + of.EVENT_CHORD] != 0 and meant:
            notes.refuse(player, players, event)
            players[event + of.EVENT_CHORD] = 0
            players[event + of.EVENT_KIND] = of.NOTHING


@njit(**COMPILED)
def queue(players: np.ndarray, event: int) -> None:
    """Puts an event behind those of its frame and of earlier ones."""
    place, size = players[of.PLAYER_QUEUED], of.EVENT_SLOTS
    while place > 0:
        before = of.PLAYER_QUEUE + (place - 1) * size
        if players[before + of.EVENT_FRAME] <= players[event + of.EVENT_FRAME]:
            break
        for each in range(size):
            players[before + size + each] = players[before + each]
        place -= 1
    for each in range(size):
        players[of.PLAYER_QUEUE + place * size + each] = players[event + each]
    players[of.PLAYER_QUEUED] += 1
