"""The records of an instrument's image, and the C header from which the shell has them and the kernels' memory."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numba import types

from app.export.plugin.parts import AMP, EFFECTS
from app.export.plugin.texts import PARTS
from engine import bounds
from engine.kernels import constants as of
from engine.kernels import mixer_records as mixed
from engine.kernels import plugin
from engine.kernels.fields import R, W
from engine.kernels.records import EVENT, NEEDS, PLAYER, REPORT, RESPONSES, TABLE
from engine.kernels.voice_records import TENSION_PROGRAM, TRUTH_PROGRAM, voice_bytes
from engine.voices.mixer import LIMITER_RELEASE_S, VOLUME_SMOOTHING_S

Record = np.dtype[np.void]

MOST_IMAGES = 128
MOST_PARAMETERS = 64
MOST_TARGETS = 8
KINDS = ("source", "volume", "value", "macro", "effect", "amp")  # of parameters
SOURCES = ("model", "truth", "difference")

PARAMETER = np.dtype(
    [
        ("id", np.uint32),
        ("kind", np.int32),
        ("index", np.int32),  # among the parameters of its kind; of a value, in the order of the kernels
        ("steps", np.int32),  # of whole numbers, each with its word, with spaces between; 0: it is real
        ("low", R),
        ("high", R),
        ("standard", R),
        ("curve", R),  # how many times as fast a knob moves it at the end as at the start; 1: evenly
        ("name", "S64"),
        ("module", "S64"),
        ("unit", "S16"),
        ("words", "S64"),
    ]
)
TARGET = np.dtype([("parameter", np.int32), ("spare", np.int32), ("low", R), ("high", R)])
MACRO = np.dtype([("count", np.int32), ("spare", np.int32), ("targets", TARGET, MOST_TARGETS)])
IMAGE = np.dtype(
    [
        *((name, W) for name in ("table", "table_slots", "model", "model_slots", "truth", "truth_slots")),  # in slots
        *((name, W) for name in ("parameters", "parameter_count", "macros", "macro_count")),  # in bytes
        ("taps", W),
        ("body", W),
        ("kit", W),  # drums; 0: strings
        ("kit_slots", W),
        ("kit_room", W),  # slots behind kit and table in which drums are computed
        ("table_room", W),
        ("wheel_effect", W),  # which of EFFECTS the modulation wheel moves, -1: none
        ("modes", W),
        ("most_notes", W),
        ("longest_s", R),
        ("wheel_goal", R),
        ("level_db", R),
        ("id", "S128"),
        ("name", "S64"),
        ("description", "S512"),
        ("maker", "S64"),
        ("category", "S16"),
        ("uid", np.uint8, 16),  # of VST3
    ]
)
STRUCTURES: dict[str, Record] = {
    "parameter": PARAMETER,
    "macro": MACRO,
    "image": IMAGE,
    "event": EVENT,
    "report": REPORT,
    "needs": NEEDS,
    "responses": RESPONSES,
    "impulse": mixed.IMPULSE,
    "tension_program": TENSION_PROGRAM,
    "truth_program": TRUTH_PROGRAM,
    "table_memory": TABLE,
    "player_memory": PLAYER,
    "mixer_memory": mixed.MIXER,
    "convolver_memory": mixed.CONVOLVER,
}
_NUMBERS = {"f8": "double", "i8": "int64_t", "i4": "int32_t", "u4": "uint32_t", "u1": "uint8_t"}
_ARGUMENTS = {types.int64: "int64_t", types.float64: "double"}
_COUNTS = (
    "QUANTUM AHEAD NOTE_ON NOTE_OFF BEND CONTROLLER TUNE PARAMETER TABLE CHOKE ANY EVENTS REPORTS MOST_NOTES "
    "MOST_SOURCES KEYS CHANNELS BEGAN BODY_SLOTS"
)


def layout_header(version: str) -> str:
    """The C header with records and constants of the image and of the kernels' memory, and the kernels' entries.

    `version`: the program's, as text.
    """
    none = voice_bytes(0) // 8
    constants: dict[str, float] = {
        **{name: getattr(of, name) for name in _COUNTS.split()},
        "BODY_MIX": of.VALUE.body_mix,
        "EARLY": mixed.EARLY,
        "REACH": mixed.REACH,
        "MOST_IMAGES": MOST_IMAGES,
        "MOST_PARAMETERS": MOST_PARAMETERS,
        "EFFECT_COUNT": len(EFFECTS),
        "VOICE_SLOTS_FIXED": none,
        "VOICE_SLOTS_A_MODE": voice_bytes(1) // 8 - none,
        "BODY_SIZE_HIGHEST": bounds.BODY_SIZE[1],
        "ROOM_T60_HIGHEST_S": bounds.ROOM_T60_S[1],
        "LIMITER_RELEASE_S": LIMITER_RELEASE_S,
        "VOLUME_SMOOTHING_S": VOLUME_SMOOTHING_S,
    }
    for prefix, names in (("KIND_", KINDS), ("SOURCE_", SOURCES), ("EFFECT_", EFFECTS), ("", AMP)):
        constants |= {f"{prefix}{name.replace('.', '_').upper()}": place for place, name in enumerate(names)}
    lines = ["#include <stdint.h>", f'#define LS_VERSION "{version}"']
    lines += [f"#define {name} {value}" for name, value in constants.items()]
    for name, kind in STRUCTURES.items():
        lines += [f"typedef {_structure(kind)} {name};"]
        lines += [f'_Static_assert(sizeof({name}) == {kind.itemsize}, "as Python has it");']
    entries = (name for names in PARTS.values() for name in names)
    lines += [f"#define ENTRIES(OF, number) {' '.join(map(_entry, entries))}"]
    return "\n".join(lines) + "\n"


def _entry(name: str) -> str:
    arguments = (_ARGUMENTS[kind] for kind in plugin.ENTRIES[name][1])
    return f"OF({', '.join(('number', name, *arguments))})"


def _structure(kind: Record) -> str:
    return f"struct {{ {' '.join(_fields(kind))} }}"


def _fields(kind: Record) -> Iterator[str]:
    """The C declaration of each field of a record, such as "double low;"."""
    structures = {record: name for name, record in STRUCTURES.items()}
    for name in kind.names or ():
        part, shape = kind[name].subdtype or (kind[name], ())
        if part.kind == "S":
            written, shape = "char", (part.itemsize,)
        elif part.names:
            written = structures.get(part) or _structure(part)
        else:
            written = _NUMBERS[part.str[1:]]
        yield f"{written} {name}{''.join(f'[{length}]' for length in shape)};"
