"""The drums of a plug-in, whose knobs are turned.

The blocks of keys are written again when these are struck or heard.

A kit is memory of numbers, as `written` lays it out: its values, its keys, its drums, and room to work in.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from engine.kernels import constants as of
from engine.kernels import drum_modes as drums
from engine.kernels.compiled import COMPILED
from engine.kernels.constants import KEYS
from engine.kernels.drum_modes import D1, D3, DRUM, HARDEST, MODULUS, ORDERS, ROWS, SOFTEST, SURFACE
from engine.kernels.memory import matrix, part, player_at, reals, table_at, voice_at, wholes
from engine.kernels.records import DRUM_ROWS, Event

# Slots of a kit, of a key and of a drum behind its own values. R real number, W whole number
HIGHEST_HZ = 0  # R
CAPACITY = 1  # W modes of a key
MOST = 2  # W modes of a surface
BESSELS, STEPS, COLUMNS = 3, 4, 5  # W slot of a table of Bessel functions, its rows and columns
WORK = 6  # W slot
FOUND = 7  # W slot of the modes of all keys, (KEYS, ROWS, CAPACITY)
STALE = 8  # W whether any key is
VALUES = 9  # R five, in the order of FOLLOWED
FIRST_KEY = 14
KEY_DRUM = 0  # W slot of its drum; 0: it has none
KEY_RATIO, KEY_SOFTEST, KEY_HARDEST = 1, 2, 3  # R
KEY_STALE = 4  # W sum of what of it has changed
KEY_MODES = 5  # W
KEY_TUNED = 6  # R its drum as it is tuned
KEY = KEY_TUNED + DRUM
LIST, LISTED, AIR, LOW, AIR_TERMS = range(DRUM, DRUM + 5)  # W slots of list and table, and their sizes
AIR_REACH = DRUM + 5  # R

FOLLOWED = (of.MODULUS_FACTOR, of.DECAY, of.BRIGHTNESS_DECAY, of.POINT, of.POINT + 1)
MODES_MOVED, LOSSES_MOVED, PLACES_MOVED = 1, 2, 4
MOVES = (MODES_MOVED, LOSSES_MOVED, LOSSES_MOVED, PLACES_MOVED, PLACES_MOVED)


@njit(**COMPILED)
def begin(kit_address: int, table_address: int) -> None:
    """Write all keys' blocks into an instrument's table."""
    kit, counts, values = reals(kit_address), wholes(kit_address), table_at(table_address).values
    drums.tabulate(_bessels(kit, counts))
    for which in FOLLOWED:
        follow(kit_address, which, values[which])
    for key in range(KEYS):
        _update(kit_address, table_address, key)
    counts[STALE] = 0


@njit(**COMPILED)
def follow(kit_address: int, which: int, value: float) -> None:
    """Follow the change of one of the instrument's values."""
    kit, counts = reals(kit_address), wholes(kit_address)
    for number in range(len(FOLLOWED)):
        if which == FOLLOWED[number]:
            kit[VALUES + number] = value
            counts[STALE] = 1
            for key in range(KEYS):
                counts[FIRST_KEY + key * KEY + KEY_STALE] |= MOVES[number]


@njit(**COMPILED)
def prepare(kit_address: int, table_address: int, player_address: int) -> None:
    """Prepare the drums that are struck or heard in the next quantum: they follow changed values."""
    counts, player = wholes(kit_address), player_at(player_address)
    if counts[STALE] == 0:
        return
    for taken in range(player.taken, player.pushed):
        _strike(kit_address, table_address, player.events[taken % of.EVENTS])
    for place in range(player.queued):
        _strike(kit_address, table_address, player.queue[place])
    for number in range(of.MOST_NOTES):
        note = player.notes[number]
        key, voice = note.key, note.voices[0]
        if note.state == of.RINGS and voice != 0:
            moved = counts[FIRST_KEY + key * KEY + KEY_STALE] & PLACES_MOVED
            if moved and voice_at(voice).next_weights == 0:  # else it fades to other places yet
                _update(kit_address, table_address, key)


@njit(**COMPILED)
def _bessels(kit: np.ndarray, counts: np.ndarray) -> np.ndarray:
    return matrix(kit, counts[BESSELS], counts[STEPS], counts[COLUMNS])


@njit(**COMPILED)
def _strike(kit_address: int, table_address: int, event: Event) -> None:
    if event.kind == of.NOTE_ON:
        _update(kit_address, table_address, event.key)


@njit(**COMPILED)
def _possible(drum: np.ndarray) -> bool:
    """Return True if `DrumParameters` would take the drum, as far as knobs and tuning change it."""
    for value in range(1, drums.X):
        if not drums.LOWEST[value - 1] <= drum[value] <= drums.HIGHEST[value - 1]:
            return False
    length, width = drum[drums.LENGTH], drum[drums.WIDTH]
    return drum[drums.THICKNESS] <= (length if drum[drums.SHAPE] == drums.BAR else min(length, width)) / 10


@njit(**COMPILED)
def _update(kit_address: int, table_address: int, key: int) -> None:
    """Write the block of a key that is stale."""
    kit, counts, table = reals(kit_address), wholes(kit_address), table_at(table_address)
    own, capacity = FIRST_KEY + key * KEY, counts[CAPACITY]
    stale, drum = counts[own + KEY_STALE], counts[own + KEY_DRUM]
    counts[own + KEY_STALE] = 0
    if stale == 0 or drum == 0:
        return
    tuned, found = (
        part(kit, own + KEY_TUNED, DRUM),
        matrix(kit, counts[FOUND] + key * ROWS * capacity, ROWS, capacity),
    )
    work = part(kit, counts[WORK], 4 * counts[MOST] + ORDERS)
    if stale & MODES_MOVED:
        for value in range(DRUM):
            tuned[value] = kit[drum + value]
        tuned[SOFTEST], tuned[HARDEST] = kit[own + KEY_SOFTEST], kit[own + KEY_HARDEST]
        tuned[MODULUS] *= kit[VALUES]
        counts[own + KEY_MODES] = 0
        if _possible(tuned):
            low, terms = counts[drum + LOW], counts[drum + AIR_TERMS]
            air = part(kit, counts[drum + AIR], 2 * low * terms).reshape(2, low, terms)
            around = matrix(kit, counts[drum + LIST], SURFACE, counts[drum + LISTED]), air, kit[drum + AIR_REACH]
            drums.tune(tuned, kit[own + KEY_RATIO], around, work, found)
            if _possible(tuned):
                most = of.MOST_DRUM_MODES
                counts[own + KEY_MODES] = drums.modes(tuned, around, kit[HIGHEST_HZ], most, work, found)
    tuned[D1], tuned[D3] = kit[drum + D1] * kit[VALUES + 1], kit[drum + D3] * kit[VALUES + 2]
    n, slots = counts[own + KEY_MODES], table.drums
    block = slots + KEYS + key * (drums.HEADER + DRUM_ROWS * capacity)
    points, tools = part(kit, VALUES + 3, table.points), (_bessels(kit, counts), work)
    drums.write(tuned, found, points, tools, table_address + 8 * block, n)
    wholes(table_address)[slots + key] = block if n > 0 and _possible(tuned) else 0
