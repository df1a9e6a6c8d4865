"""Parts beyond the table of strings that a plug-in computes sounds from: its body, and drums."""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from app.instruments.instrument import Instrument
from app.player.drum_keys import DrumKeys, struck_drum
from app.player.effects import effects_of
from engine.effects.body import body_memory
from engine.kernels import constants as of
from engine.kernels import drum_modes as kernel
from engine.kernels.fields import record_of, slots
from engine.kernels.kit import KIT, KIT_DRUM
from engine.kernels.records import DRUM, DRUM_ROWS
from engine.parameters import OF_INSTRUMENTS
from engine.resonators.base import Array
from engine.resonators.drum import around as around_of

EFFECTS = ("body.mix", "room.mix", "body.size", "room.t60_s")  # in the shell's order
MORE = 1.05  # of modes than the keys need
AMP = ("amp.drive_db", "amp.tone_db")


def body_of(instrument: Instrument) -> Array:
    """The body of an instrument as a plug-in reads it."""
    effects = effects_of(instrument.with_value("body.mix", 1.0))
    return body_memory(None if effects is None else effects.body)


@dataclass(frozen=True, eq=False)
class Kit:
    """Drums as `engine.kernels.kit` reads them. A slot is 8 bytes.

    Attributes:
        memory: the record `KIT` and all that it points to, float64 (slots,).
        room: slots behind the memory in which it works.
        modes: the most of a key at any modulus.
    """

    memory: Array
    room: int
    modes: int

    @property
    def table_room(self) -> int:
        """Slots behind an instrument's table for the drums of all keys."""
        return of.KEYS * (1 + slots(DRUM) + DRUM_ROWS * self.modes)


def kit_of(keys: DrumKeys) -> Kit:
    """The kit of an instrument of drums; keys that are silent at any modulus have no drum in it."""
    instrument = keys.instrument
    drums = keys.drums.drums
    highest_hz = keys.drums.highest_hz
    most = kernel.LOW_MODES
    lowest = OF_INSTRUMENTS["knobs.modulus"].limits[0]
    slack = DrumKeys(instrument.with_value("knobs.modulus", lowest), keys.ear, keys)  # the softest
    possible = [played.drum for played in drums]  # the instrument's own, then as keys tune them
    for variant, key in product((slack, keys), range(of.KEYS)):  # the softer, the more modes are below a frequency
        with contextlib.suppress(ValueError):
            if (drum_key := variant.of_key(key)) is not None:
                possible.append(drum_key.modes.drum)
                most = max(most, len(drum_key.modes))
    # by shape and aspect: the longest list of modes, the largest table of the air, and up to which ka that goes
    around = dict[tuple[str, float], kernel.Around]()
    for drum in possible:
        kind, (rows, air, reach) = (drum.shape, drum.aspect), around_of(drum, highest_hz, of.MOST_DRUM_MODES)
        longest, known_air, known_reach = around.get(kind, (rows, air, reach))
        if air.size < known_air.size:
            air, reach = known_air, known_reach
        around[kind] = max(rows, longest, key=np.size), air, reach
    memory = np.zeros(slots(KIT))
    places_of = dict[int, int]()  # slot of each drum's record, by its note
    furthest = 0.0

    def put(part: Array) -> int:
        """Append slots to the memory; return the first of them."""
        nonlocal memory
        memory = np.append(memory, part)
        return len(memory) - part.size

    places = {kind: (put(rows), put(air)) for kind, (rows, air, _) in around.items()}
    for played, drum in zip(drums, possible, strict=False):
        kind = drum.shape, drum.aspect
        (rows, air, reach), (rows_at, air_at) = around[kind], places[kind]
        furthest = max(furthest, reach / 2, rows[0, -1] * math.hypot(*played.place))
        record = np.zeros(1, KIT_DRUM)
        record[0] = struck_drum(played, drum), rows_at, rows.shape[1], air_at, *air.shape[1:], reach
        places_of[played.note] = put(record.view(np.float64))
    kit = record_of(memory, KIT)
    for key in range(of.KEYS):
        if (tuned := keys.tuned_to(key)) is not None:
            played, ratio = tuned
            written = kit["keys"][key]
            written["drum"], written["ratio"] = places_of[played.note], ratio
            written["softest_m_s"], written["hardest_m_s"] = played.softest_m_s, played.hardest_m_s
    modes = min(of.MOST_DRUM_MODES, round(MORE * most) + 1)
    surface = max(rows.shape[1] for rows, *_ in around.values())
    steps, columns = int(furthest / kernel.STEP) + 2, int(furthest + 12 * math.cbrt(furthest)) + 20 + 2 * kernel.TERMS
    work = len(memory) + steps * columns
    first_mode = work + 4 * surface + kernel.ORDERS
    kit["highest_hz"] = highest_hz
    kit["capacity"] = modes
    kit["most"] = surface
    kit["bessels"] = len(memory)
    kit["steps"] = steps
    kit["columns"] = columns
    kit["work"], kit["found"] = work, first_mode
    return Kit(memory, first_mode + of.KEYS * kernel.ROWS * modes - len(memory), modes)
