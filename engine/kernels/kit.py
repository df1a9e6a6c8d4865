"""The drums of a plug-in, whose knobs are turned, and their records.

The blocks of keys are written again when these are struck or heard.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from engine.kernels import constants as of
from engine.kernels import drum_modes as drums
from engine.kernels.compiled import kernel
from engine.kernels.constants import KEYS
from engine.kernels.drum_modes import D1, D3, DRUM, HARDEST, MODULUS, ORDERS, ROWS, SOFTEST, SURFACE
from engine.kernels.fields import R, W
from engine.kernels.memory import part, player_at, reals, record_at, shaped, table_at, voice_at, wholes
from engine.kernels.records import DRUM_ROWS, Event

# Records, as annotations of kernels
Kit: TypeAlias = Any
KitKey: TypeAlias = Any

FOLLOWED = (  # values that move drums
    of.VALUE.knobs_modulus,
    of.VALUE.knobs_decay,
    of.VALUE.knobs_brightness_decay,
    of.VALUE.pickup_points_0,
    of.VALUE.pickup_points_0 + 1,
)

KIT_DRUM = np.dtype(
    [
        ("drum", R, DRUM),  # with its blow
        ("around", W),  # slot of what is around a mode, (SURFACE, listed)
        ("listed", W),
        ("air", W),  # slot of the terms of the air, (2, low, terms)
        ("low", W),
        ("terms", W),
        ("reach", R),  # of the air
    ]
)

KIT_KEY = np.dtype(
    [
        ("drum", W),  # slot of its `KIT_DRUM`; 0: it has none
        ("ratio", R),  # of its pitch to that of the drum as it is given
        ("softest_m_s", R),  # speed of the softest blow
        ("hardest_m_s", R),
        ("stale", W),  # bits MODES_MOVED, LOSSES_MOVED, PLACES_MOVED: what has changed; 0: nothing
        ("modes", W),  # so many has its tuned drum; 0: it is silent
        ("tuned", R, DRUM),  # its drum as it is tuned
    ]
)

KIT = np.dtype(
    [
        ("highest_hz", R),
        ("capacity", W),  # modes of a key
        ("most", W),  # modes of a surface
        ("bessels", W),  # slot of a table of Bessel functions, …
        ("steps", W),  # … its rows …
        ("columns", W),  # … and columns
        ("work", W),  # slot of room to work in
        ("found", W),  # slot of the modes of all keys, (KEYS, ROWS, capacity)
        ("stale", W),  # whether any key is
        ("values", R, len(FOLLOWED)),  # of the instrument, in the order of FOLLOWED
        ("keys", KIT_KEY, of.KEYS),
    ]
)
"""Slots count from its beginning; what they point to follows the record."""

MODES_MOVED = 1
LOSSES_MOVED = 2
PLACES_MOVED = 4
MOVES = (MODES_MOVED, LOSSES_MOVED, LOSSES_MOVED, PLACES_MOVED, PLACES_MOVED)  # by the values of FOLLOWED

kit_at, kit_drum_at = record_at(KIT), record_at(KIT_DRUM)


@kernel
def begin(kit_address: int, table_address: int) -> None:
    """Write all keys' blocks into an instrument's table."""
    values = table_at(table_address).values
    drums.tabulate(_bessels(kit_address))
    for which in FOLLOWED:
        follow(kit_address, which, values[which])
    for key in range(KEYS):
        _update(kit_address, table_address, key)
    kit_at(kit_address).stale = 0


@kernel
def follow(kit_address: int, which: int, value: float) -> None:
    """Note the change of one of the instrument's values, by its number, if drums depend on it: all keys are stale."""
    kit = kit_at(kit_address)
    for number in range(len(FOLLOWED)):
        if which == FOLLOWED[number]:
            kit.values[number] = value
            kit.stale = 1
            for key in kit.keys:
                key.stale |= MOVES[number]


@kernel
def prepare(kit_address: int, table_address: int, player_address: int) -> None:
    """Prepare the drums that are struck or heard in the next quantum: they follow changed values."""
    kit, player = kit_at(kit_address), player_at(player_address)
    if kit.stale == 0:
        return
    for taken in range(player.taken, player.pushed):
        _strike(kit_address, table_address, player.events[taken % of.EVENTS])
    for place in range(player.queued):
        _strike(kit_address, table_address, player.queue[place])
    for note in player.notes:
        key, voice = note.key, note.voices[0]
        if note.state == of.RINGS and voice != 0:
            moved = kit.keys[key].stale & PLACES_MOVED
            if moved and voice_at(voice).next_weights == 0:  # else it fades to other places yet
                _update(kit_address, table_address, key)


@kernel
def _bessels(kit_address: int) -> np.ndarray:
    """The kit's table of Bessel functions, (steps, columns), see `drum_modes.tabulate`."""
    kit = kit_at(kit_address)
    return shaped(reals(kit_address), kit.bessels, (kit.steps, kit.columns))


@kernel
def _strike(kit_address: int, table_address: int, event: Event) -> None:
    """Bring the key of an event up to date, if the event begins a note."""
    if event.kind == of.NOTE_ON:
        _update(kit_address, table_address, event.key)


@kernel
def _possible(drum: np.ndarray) -> bool:
    """Return True if `DrumParameters` would take the drum, as far as knobs and tuning change it."""
    for value in range(1, drums.X):
        if not drums.LOWEST[value - 1] <= drum[value] <= drums.HIGHEST[value - 1]:
            return False
    length, width = drum[drums.LENGTH], drum[drums.WIDTH]
    return drum[drums.THICKNESS] <= (length if drum[drums.SHAPE] == drums.BAR else min(length, width)) / 10


@kernel
def _update(kit_address: int, table_address: int, key: int) -> None:
    """Bring the block of a key in the table up to date, where the key is stale.

    Its modes are computed only if they have moved. A key whose drum became impossible has none.
    """
    kit = kit_at(kit_address)
    memory = reals(kit_address)
    table = table_at(table_address)
    kit_key, capacity = kit.keys[key], kit.capacity
    stale, kit_key.stale = kit_key.stale, 0
    if stale == 0 or kit_key.drum == 0:
        return
    struck, tuned = kit_drum_at(kit_address + 8 * kit_key.drum), kit_key.tuned
    modal = shaped(memory, kit.found + key * ROWS * capacity, (ROWS, capacity))
    work = part(memory, kit.work, 4 * kit.most + ORDERS)
    if stale & MODES_MOVED:
        for value in range(DRUM):
            tuned[value] = struck.drum[value]
        tuned[SOFTEST], tuned[HARDEST] = kit_key.softest_m_s, kit_key.hardest_m_s
        tuned[MODULUS] *= kit.values[0]
        kit_key.modes = 0
        if _possible(tuned):
            air = part(memory, struck.air, 2 * struck.low * struck.terms).reshape(2, struck.low, struck.terms)
            around = shaped(memory, struck.around, (SURFACE, struck.listed)), air, struck.reach
            drums.tune(tuned, kit_key.ratio, around, work, modal)
            if _possible(tuned):
                kit_key.modes = drums.modes(tuned, around, kit.highest_hz, of.MOST_DRUM_MODES, work, modal)
    tuned[D1], tuned[D3] = struck.drum[D1] * kit.values[1], struck.drum[D3] * kit.values[2]
    slots, block = table.drums, table.drums + KEYS + key * (drums.HEADER + DRUM_ROWS * capacity)
    points, tools = kit.values[3 : 3 + table.points], (_bessels(kit_address), work)
    drums.write(tuned, modal, points, tools, table_address + 8 * block, kit_key.modes)
    wholes(table_address)[slots + key] = block if kit_key.modes > 0 and _possible(tuned) else 0
