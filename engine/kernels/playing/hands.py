"""Hands on strings that ring: hammer-on, pull-off, slide, release, vibrato, tremolo and harmonics.

With the legato footswitch down, a key moves the note of a key that is held on its channel: it shortens the same
string without a pluck (hammer-on), or slides there where portamento is on. A key that is released gives the note back
to the highest one that is still down (pull-off). A key that is released damps its string, unless the pedal or the
instrument lets it ring.

Harmonics: a finger touches the string at a node as it is plucked, and leaves after some periods. Tremolo: a key that
is held plucks again and again. A footswitch turns each on where its parameter is off.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.kernels import contact, strings
from engine.kernels import layout as at
from engine.kernels import playing_layout as of
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import reals, wholes
from engine.kernels.playing import changes, channels, keys, notes, slots, voices

BEND_S, LIFT_S = 0.006, 0.004  # of the glide to other modes, as a bend or as a finger leaves
STOP_S = 0.03  # of the shortest fade
PLAIN_DB = 12.0  # by how much fingers are quieter on plain strings than on wound ones: an estimate
USUAL_TREMOLO_HZ = 10.0  # of its footswitch
VIBRATO_QUANTA = 8  # of a glide, of which a vibrato is made


@njit(**COMPILED)
def _move(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    number: int,
    key: int,
    frame: int,
    now: int,
) -> bool:
    """Shortens or lengthens the string of a note for another key; False where it cannot play that key."""
    note, count, mode = slots.note(number), tables[of.TABLE_STRINGS], tables[of.TABLE_MODE]
    pitch_hz, string = keys.pitch_of(table, tables, key), players[note + of.NOTE_STRING]
    if count > 0 and string < 0:
        string = keys.chosen(table, count, players[note + of.NOTE_KEY])
    if pitch_hz <= 0.0 or (count > 0 and key < table[of.TABLE_OPEN + string * of.OPEN_SLOTS + of.OPEN_NOTE]):
        return False
    modes, _ = keys.string_of(player, players, table, tables, key, string, pitch_hz, False, slots.moment(player, 3))
    if modes < 1:
        return False
    if players[note + of.NOTE_PLACE] % 256 != 0:  # a place for each key
        players[note + of.NOTE_PLACE] += key - players[note + of.NOTE_KEY]
        for each in range(of.MOST_NOTES):
            other = slots.note(each)
            if (
                each != number
                and slots.sounds(players, other)
                and players[other + of.NOTE_PLACE] == players[note + of.NOTE_PLACE]
            ):
                players[other + of.NOTE_HAS_PLACE] = 0
                voices.release_note(player, players, other, notes.PLUCK_STOPS_S, frame)
    players[note + of.NOTE_STRING], players[note + of.NOTE_KEY] = string, key
    seconds = channels.moves_in_s(players, mode, players[note + of.NOTE_CHANNEL])
    if players[note + of.NOTE_MEMBER] == 0:
        level_db = keys.value_of(player, players, table, tables, of.DAMPER_DB)
        level_db += channels.loudness_db(players, mode, players[note + of.NOTE_CHANNEL])
        if not strings.is_wound(player[note + of.NOTE_OWN : note + of.NOTE_OWN + of.STRING]):
            level_db -= PLAIN_DB
        slid_m = abs(slots.moment(player, 3)[of.LENGTH] - player[note + of.NOTE_STRING_NOW + of.LENGTH])
        slides_s = seconds if seconds > channels.HAMMER_S else 0.0
        stroke = players[note + of.NOTE_AGE] if table[of.TABLE_VARIATION] > 0.0 else 0
        strength = 1.0 if slides_s > 0.0 else changes.landing(player, players, table, note)
        contact.touch(
            player, players, table, of.RELEASE, level_db, strength, 1.0, stroke, key, frame, slid_m, slides_s
        )
    changes.retune(player, players, table, tables, number, seconds, frame, now)
    return True


@njit(**COMPILED)
def _move_others(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    first: int,
    before: int,
    key: int,
    frame: int,
    now: int,
) -> None:
    """Lets the other strings of a course follow the first, a note that has moved."""
    id, channel = players[first + of.NOTE_ID], players[first + of.NOTE_CHANNEL]
    for number in range(of.MOST_NOTES):
        note = slots.note(number)
        same = players[note + of.NOTE_KEY] == before and players[note + of.NOTE_CHANNEL] == channel
        same = same and players[note + of.NOTE_MEMBER] != 0 and players[note + of.NOTE_ID] == id
        if same and slots.sounds(players, note):
            _move(player, players, table, tables, number, key, frame, now)


@njit(**COMPILED)
def hammer_on(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, event: int, frame: int, now: int
) -> bool:
    """Lets a key have the latest note that is held on its channel, where legato is on; whether it has one.

    Where the event gives a string, only a note on that string.
    """
    channel, key, found, age = players[event + of.EVENT_CHANNEL], players[event + of.EVENT_KEY], -1, 0
    place = channels.place_of(players, tables, event)
    if not channels.switched(players, tables[of.TABLE_MODE], channel, of.CHANNEL_LEGATO):
        return False
    for number in range(of.MOST_NOTES):
        note = slots.note(number)
        held = players[note + of.NOTE_HELD] != 0 and players[note + of.NOTE_CHANNEL] == channel
        if (
            held
            and players[note + of.NOTE_MEMBER] == 0
            and (place % 256 != 0 or players[note + of.NOTE_PLACE] == place)
            and players[note + of.NOTE_AGE] > age
            and slots.sounds(players, note)
        ):
            found, age = number, players[note + of.NOTE_AGE]
    if found < 0:
        return False
    note = slots.note(found)
    id, before = players[note + of.NOTE_ID], players[note + of.NOTE_KEY]
    if key == before or not _move(player, players, table, tables, found, key, frame, now):
        return False
    _move_others(player, players, table, tables, note, before, key, frame, now)
    notes.report(player, players, of.ENDED, id, channel, before, now, 0.0)
    notes.reported(players)
    for number in range(of.MOST_NOTES):
        other = slots.note(number)
        if players[other + of.NOTE_MEMBER] != 0 and players[other + of.NOTE_ID] == id:
            players[other + of.NOTE_ID] = players[event + of.EVENT_ID]
    players[note + of.NOTE_ID] = players[event + of.EVENT_ID]
    notes.report_began(player, players, tables, event, found, slots.moment(player, 3))
    return True


@njit(**COMPILED)
def _pull_off(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    number: int,
    frame: int,
    now: int,
) -> bool:
    """Gives the note of a released key to the highest key that is down and has none; whether there is one."""
    channel, before = players[slots.note(number) + of.NOTE_CHANNEL], players[slots.note(number) + of.NOTE_KEY]
    if not channels.switched(players, tables[of.TABLE_MODE], channel, of.CHANNEL_LEGATO):
        return False
    for key in range(of.KEYS - 1, -1, -1):
        free = channels.is_down(players, channel, key)
        for each in range(of.MOST_NOTES):
            other = slots.note(each)
            same = players[other + of.NOTE_KEY] == key and players[other + of.NOTE_CHANNEL] == channel
            same = same and players[other + of.NOTE_MEMBER] == 0
            free = free and not (same and players[other + of.NOTE_HELD] != 0 and slots.sounds(players, other))
        if free and _move(player, players, table, tables, number, key, frame, now):
            _move_others(player, players, table, tables, slots.note(number), before, key, frame, now)
            return True
    return False


@njit(**COMPILED)
def note_off(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    event: int,
    frame: int,
    now: int,
) -> None:
    channel, key = players[event + of.EVENT_CHANNEL], players[event + of.EVENT_KEY]
    place = channels.place_of(players, tables, event)
    for turn in range(2 * of.MOST_NOTES):  # first strings of courses first, which the others follow
        number = turn % of.MOST_NOTES
        note = slots.note(number)
        same = players[note + of.NOTE_KEY] == key and players[note + of.NOTE_CHANNEL] == channel
        same = same and (players[note + of.NOTE_MEMBER] == 0) == (turn < of.MOST_NOTES)
        given = players[event + of.EVENT_STRING] != 0
        same = same and (not given or players[note + of.NOTE_PLACE] % notes.MEMBERS_APART == place)
        if same and players[note + of.NOTE_HELD] != 0 and slots.sounds(players, note):
            if players[note + of.NOTE_MEMBER] == 0 and _pull_off(player, players, table, tables, number, frame, now):
                continue
            players[note + of.NOTE_HELD] = 0
            players[note + of.NOTE_KEPT] = channels.pedal_down(players, tables[of.TABLE_MODE], channel)
            changes.damp(player, players, table, tables, number, frame, now)


@njit(**COMPILED)
def _is_meant(players: np.ndarray, event: int, note: int) -> bool:
    """Whether an event is for a note: of its number, channel and key, as far as they are given."""
    id, channel, key = players[event + of.EVENT_ID], players[event + of.EVENT_CHANNEL], players[event + of.EVENT_KEY]
    if players[note + of.NOTE_STATE] != of.RINGS or (id != 0 and players[note + of.NOTE_ID] != id):
        return False
    return channel in (of.ANY, players[note + of.NOTE_CHANNEL]) and key in (of.ANY, players[note + of.NOTE_KEY])


@njit(**COMPILED)
def tune(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, event: int, frame: int, now: int
) -> None:
    """Bends single notes."""
    semitones = min(max(player[event + of.EVENT_VALUE], -channels.WIDEST_SEMITONES), channels.WIDEST_SEMITONES)
    for number in range(of.MOST_NOTES):
        note = slots.note(number)
        if _is_meant(players, event, note) and slots.sounds(players, note):
            player[note + of.NOTE_TUNED] = semitones
            changes.retune(player, players, table, tables, number, BEND_S, frame, now)


@njit(**COMPILED)
def choke(player: np.ndarray, players: np.ndarray, event: int, frame: int) -> None:
    """Lets single notes fade out fast, though their instrument lets them ring; no release of their keys follows."""
    id, channel, key = players[event + of.EVENT_ID], players[event + of.EVENT_CHANNEL], players[event + of.EVENT_KEY]
    seconds = player[event + of.EVENT_VALUE] if player[event + of.EVENT_VALUE] > 0.0 else STOP_S
    for number in range(of.MOST_NOTES):
        note = slots.note(number)
        if _is_meant(players, event, note):
            if players[note + of.NOTE_HAS_PLACE] != 0:
                channels.release_key(players, players[note + of.NOTE_CHANNEL], players[note + of.NOTE_KEY])
            voices.release_note(player, players, note, seconds, frame)
            players[note + of.NOTE_HAS_PLACE] = 0
    if id != 0 and key == of.ANY:
        return
    for each in range(of.CHANNELS * of.KEYS):  # whose notes may have ended
        if channel in (of.ANY, each // of.KEYS) and key in (of.ANY, each % of.KEYS):
            channels.release_key(players, each // of.KEYS, each % of.KEYS)


@njit(**COMPILED)
def _vibrate(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, number: int, now: int
) -> None:
    """Lets a note glide to where its vibrato is some quanta later; all strings of a course alike."""
    note, depth = slots.note(number), keys.value_of(player, players, table, tables, of.VIBRATO_CENTS) / 100
    if depth == 0.0 and player[note + of.NOTE_VIBRATO] == 0.0:
        return
    ahead = now + VIBRATO_QUANTA * at.QUANTUM - players[note + of.NOTE_BEGAN]
    hz = keys.value_of(player, players, table, tables, of.VIBRATO_HZ)
    player[note + of.NOTE_VIBRATO] = depth * math.sin(2 * math.pi * hz * max(ahead, 0) / player[of.PLAYER_RATE])
    seconds = VIBRATO_QUANTA * at.QUANTUM / player[of.PLAYER_RATE]
    changes.retune(player, players, table, tables, number, seconds, 0, now)


@njit(inline="always", **COMPILED)
def follow_hands(player: np.ndarray, players: np.ndarray, mixers: np.ndarray, now: int) -> None:
    """Lifts fingers from strings that they touch, and plucks again what a tremolo plucks, in the next quantum."""
    address = players[of.PLAYER_TABLE]
    if address == 0:
        return
    table, tables, end = reals(address), wholes(address), now + at.QUANTUM
    if tables[of.TABLE_DRUMS] != 0:
        return
    for number in range(of.MOST_NOTES):
        note = slots.note(number)
        if players[note + of.NOTE_STATE] != of.RINGS:
            continue
        if players[note + of.NOTE_TOUCHED] != 0 and players[note + of.NOTE_LIFTED] < end:
            changes.retune(player, players, table, tables, number, LIFT_S, players[note + of.NOTE_LIFTED], now)
        if (now - players[note + of.NOTE_BEGAN]) // at.QUANTUM % VIBRATO_QUANTA == 0:
            _vibrate(player, players, table, tables, number, now)
        if (
            players[note + of.NOTE_HELD] == 0
            or players[note + of.NOTE_RELEASED] != 0
            or not slots.sounds(players, note)
        ):
            continue
        channel, switch = players[note + of.NOTE_CHANNEL], of.CHANNEL_TREMOLO
        if players[note + of.NOTE_MEMBER] != 0 or players[note + of.NOTE_BY_HAND] != 0:
            continue
        hz = keys.technique_of(player, players, table, tables, channel, of.TREMOLO_HZ, switch, USUAL_TREMOLO_HZ)
        due = players[note + of.NOTE_BEGAN] + slots.frames(player, 1 / hz) if hz > 0.0 else end
        if due < end:
            _pluck_again(player, players, table, tables, mixers, note, max(due, now))


@njit(inline="always", **COMPILED)
def _pluck_again(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    mixers: np.ndarray,
    note: int,
    frame: int,
) -> None:
    """Plucks the string of a note again: another note with its number, which ends without a report of its own."""
    event = of.PLAYER_AGAIN
    for slot in range(of.EVENT_SLOTS):
        players[event + slot] = 0
    players[event + of.EVENT_FRAME], players[event + of.EVENT_KIND] = frame, of.NOTE_ON
    players[event + of.EVENT_CHANNEL] = players[note + of.NOTE_CHANNEL]
    players[event + of.EVENT_KEY] = players[note + of.NOTE_KEY]
    players[event + of.EVENT_ID] = players[note + of.NOTE_ID]
    if players[note + of.NOTE_PLACE] % 256 == 0:
        players[event + of.EVENT_STRING] = players[note + of.NOTE_PLACE] // 256
    player[event + of.EVENT_VALUE] = player[note + of.NOTE_VELOCITY]
    players[note + of.NOTE_ID], players[note + of.NOTE_BEGAN] = 0, frame
    tuned, before = player[note + of.NOTE_TUNED], players[of.PLAYER_AGE]
    notes.strike(player, players, table, tables, mixers, event)
    for number in range(of.MOST_NOTES):
        made = slots.note(number)
        if tuned != 0.0 and players[made + of.NOTE_STATE] == of.RINGS and players[made + of.NOTE_AGE] > before:
            player[made + of.NOTE_TUNED] = tuned
            changes.retune(player, players, table, tables, number, 0.0, 0, mixers[at.M_FRAMES])
