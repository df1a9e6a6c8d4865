"""Notes that ring follow knobs, wheels and dampers: their voices glide to other modes, all of a note alike."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.kernels import contact
from engine.kernels import layout as at
from engine.kernels import playing_layout as of
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import reals, wholes
from engine.kernels.playing import channels, keys, slots, voices

DAMPER_S = 0.012  # of the glide to other modes
LANDS = 0.03  # strength of what lands on a string at rest: an estimate


@njit(**COMPILED)
def landing(player: np.ndarray, players: np.ndarray, table: np.ndarray, note: int) -> float:
    """Strength of the noise of what lands on a note's string: its motion, over that of a stroke of the reference.

    A mechanism, whose noise follows nothing, falls alike on every string.
    """
    if table[of.TABLE_CONTACTS + of.RELEASE * of.CONTACT + of.FOLLOWS] == 0.0:
        return 1.0
    return max(LANDS, voices.swing_m(players, note) / player[note + of.NOTE_SWING_M])


@njit(**COMPILED)
def retune(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    number: int,
    seconds: float,
    frame: int,
    now: int,
) -> None:
    """Lets a note glide to its string as knobs, wheels and damper have changed it, where they have."""
    note, string, changed = slots.note(number), slots.moment(player, 2), False
    if players[note + of.NOTE_DRUM] != 0:
        return
    keys.string_now(player, players, table, tables, note, string)
    for place in range(of.STRING):
        changed = changed or string[place] != player[note + of.NOTE_STRING_NOW + place]
        player[note + of.NOTE_STRING_NOW + place] = string[place]
    mute = keys.mute_of(player, players, table, tables, players[note + of.NOTE_CHANNEL])
    changed = changed or mute != player[note + of.NOTE_MUTE]
    player[note + of.NOTE_MUTE] = mute
    if players[note + of.NOTE_TOUCHED] != 0 and max(frame, now) >= players[note + of.NOTE_LIFTED]:
        players[note + of.NOTE_TOUCHED] = 0
        changed = True
    if not changed:
        return
    size, filled = at.RESONATOR_ROWS * players[note + of.NOTE_MODES], 0
    for source in range(of.MOST_SOURCES):
        address = players[note + of.NOTE_VOICES + source]
        if address == 0 or slots.voice_over(address):
            continue
        slot = voices.wish(player, players, number, source, address, seconds, frame, now)
        if filled == 0:
            voices.fill(player, players, table, tables, note, string, player[slot : slot + size])
            filled = slot
        else:
            for place in range(size):
                player[slot + place] = player[filled + place]


@njit(**COMPILED)
def damp(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    number: int,
    frame: int,
    now: int,
) -> None:
    """Puts the damper on a string or a drum that nothing holds."""
    note = slots.note(number)
    held = players[note + of.NOTE_HELD] + players[note + of.NOTE_KEPT] + players[note + of.NOTE_DAMPED]
    if held != 0 or tables[of.TABLE_LET_RING] != 0:
        return
    players[note + of.NOTE_DAMPED] = 1
    if players[note + of.NOTE_DRUM] == 0:
        retune(player, players, table, tables, number, DAMPER_S, frame, now)
        if players[note + of.NOTE_MEMBER] != 0:
            return
        level_db = keys.value_of(player, players, table, tables, of.DAMPER_DB)
        level_db += channels.loudness_db(players, tables[of.TABLE_MODE], players[note + of.NOTE_CHANNEL])
        stroke, key = (
            players[note + of.NOTE_AGE] if table[of.TABLE_VARIATION] > 0.0 else 0,
            players[note + of.NOTE_KEY],
        )
        strength = landing(player, players, table, note)
        contact.touch(player, players, table, of.RELEASE, level_db, strength, 1.0, stroke, key, frame, 0.0, 0.0)
        return
    t60_s = keys.value_of(player, players, table, tables, of.RELEASE_S)
    for source in range(of.MOST_SOURCES):
        address = players[note + of.NOTE_VOICES + source]
        if address == 0 or slots.voice_over(address):
            continue
        voice, n = reals(address), wholes(address)[at.MODES]
        slot = voices.wish(player, players, number, source, address, DAMPER_S, frame, now)
        first = at.state(n) + at.OMEGA_SQUARED * n
        for place in range(at.RESONATOR_ROWS * n):
            player[slot + place] = voice[first + place]
            if n <= place < 2 * n:  # σ
                player[slot + place] += math.log(1000.0) / t60_s


@njit(**COMPILED)
def damp_unkept(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, frame: int, now: int
) -> None:
    """Puts the damper on strings that a pedal kept, and keeps no longer."""
    for number in range(of.MOST_NOTES):
        note = slots.note(number)
        if players[note + of.NOTE_KEPT] == 0 or not slots.sounds(players, note):
            continue
        if not channels.pedal_down(players, tables[of.TABLE_MODE], players[note + of.NOTE_CHANNEL]):
            players[note + of.NOTE_KEPT] = 0
            damp(player, players, table, tables, number, frame, now)


@njit(**COMPILED)
def glide(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    channel: int,
    seconds: float,
    frame: int,
    now: int,
) -> None:
    """Lets strings follow the wheels of a channel; -1: all, whatever has changed."""
    for number in range(of.MOST_NOTES):
        note = slots.note(number)
        moved = channel < 0 or channels.acts_on(tables[of.TABLE_MODE], channel, players[note + of.NOTE_CHANNEL])
        if moved and slots.sounds(players, note):
            retune(player, players, table, tables, number, seconds, frame, now)
