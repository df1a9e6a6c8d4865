"""An instrument as one block of bytes, and the header from which the shell has all places in memory.

It holds the table of an instrument's keys with their gains, the programs of model and solver, the modes of its
body, macros and parameters. Nothing depends on the rate, which the shell sets when
the host does. The responses of body and room are computed then.
"""

from __future__ import annotations

import ctypes
import uuid
import zlib
from collections.abc import Iterable
from dataclasses import dataclass

from app.export.plugin.identity import identifier
from app.export.plugin.parts import AMP, EFFECTS, body_of, effects_there, kit_of
from app.instrument.compiled import InstrumentPlayer
from app.instrument.drum_keys import DrumKeys
from app.instrument.strings import StringKeys
from app.instrument.table import WHEELED, wheel_goal
from app.patches.drums import Drums
from app.patches.patch import ASSIGNABLE, Patch
from app.shared.parameters import MACROS, OF_CHOICES, OF_PATCHES, Parameter
from engine import bounds
from engine.effects.room import NOISE_FRAMES
from engine.kernels import constants as of
from engine.kernels import mixer_records as mixed
from engine.kernels.fields import record_of, slot, slots
from engine.kernels.records import EVENT, NEEDS, PLAYER, REPORT, RESPONSES, TABLE
from engine.kernels.voice_records import TENSION_PROGRAM, TRUTH_PROGRAM, voice_bytes
from engine.levels import FULL_SCALE_M, FULL_SCALE_M_S
from engine.presets import Preset
from engine.voices.derivative import differentiator_taps
from engine.voices.mixer import LIMITER_RELEASE_S, VOLUME_SMOOTHING_S

PREPARED_HZ = 48_000
MAKER = "Learned Strings"
MOST_NOTES = 40
MOST_PARAMETERS, MOST_TARGETS = 64, 8  # of the shell
MOST_LOUD_S = 30.0  # after its last key an instrument may ring on so long
NOISE_BYTES = 8  # of a frame
SOURCE, VOLUME, VALUE, MACRO, EFFECT, AMPLIFIER = range(6)  # kinds of the shell's parameters
SOURCE_ID = "source"
SOURCES = ("model", "truth", "difference")
DRUM_PARAMETERS = (
    "knobs.decay",
    "knobs.brightness_decay",
    "knobs.modulus",
    "pluck.curve",
    "damping.release_t60_s",
    "noise.onset_db",
    "pickup.points.0",
    "pickup.points.1",
)  # that drums follow


class _Parameter(ctypes.Structure):
    _fields_ = (
        ("id", ctypes.c_uint32),
        ("kind", ctypes.c_int32),
        ("index", ctypes.c_int32),
        ("steps", ctypes.c_int32),
        ("low", ctypes.c_double),
        ("high", ctypes.c_double),
        ("standard", ctypes.c_double),
        ("curve", ctypes.c_double),
        ("name", ctypes.c_char * 64),
        ("module", ctypes.c_char * 64),
        ("unit", ctypes.c_char * 16),
        ("words", ctypes.c_char * 64),
    )


class _Target(ctypes.Structure):
    _fields_ = (
        ("parameter", ctypes.c_int32),
        ("spare", ctypes.c_int32),
        ("low", ctypes.c_double),
        ("high", ctypes.c_double),
    )


class _Macro(ctypes.Structure):
    _fields_ = (("count", ctypes.c_int32), ("spare", ctypes.c_int32), ("targets", _Target * MOST_TARGETS))


class _Header(ctypes.Structure):
    _fields_ = (
        ("magic", ctypes.c_char * 8),
        *(
            (name, ctypes.c_int64)
            for name in (
                "version",
                "bytes",
                "table",
                "table_slots",
                "model",
                "model_slots",
                "truth",
                "truth_slots",
                "parameters",
                "parameter_count",
                "macros",
                "macro_count",
                "taps",
                "body",
            )
        ),
        *(
            (name, ctypes.c_int64)
            for name in (
                "kit",
                "kit_slots",
                "kit_room",
                "table_room",
                "wheel_effect",
                "modes",
                "most_notes",
            )
        ),
        ("longest_s", ctypes.c_double),
        ("wheel_goal", ctypes.c_double),
        ("level_db", ctypes.c_double),
        ("id", ctypes.c_char * 128),
        ("name", ctypes.c_char * 64),
        ("description", ctypes.c_char * 512),
        ("maker", ctypes.c_char * 64),
        ("features", ctypes.c_char * 128),
        ("category", ctypes.c_char * 16),
        ("uid", ctypes.c_uint8 * 16),
    )


@dataclass(frozen=True)
class Control:
    """A parameter of a plug-in; `id` is of the table of parameters, `steps` are words for whole values."""

    id: str
    name: str
    low: float
    high: float
    standard: float
    steps: tuple[str, ...] = ()


@dataclass(frozen=True)
class Image:
    """A plug-in's instrument.

    Attributes:
        id: of the plug-in, the same for every version of the instrument.
        parameters: in the shell's order.
        left_out: targets of macros that the plug-in cannot move.
    """

    id: str
    name: str
    content: bytes
    parameters: tuple[Control, ...]
    left_out: tuple[str, ...]

    @property
    def bytes(self) -> int:
        """The size in bytes, with the noise of rooms, which instruments of a bank share."""
        return len(self.content) + NOISE_FRAMES * NOISE_BYTES


def image_of(patch: Patch, preset: Preset) -> Image:
    """The image of an instrument.

    Raises:
        ValueError: its model learned one string only, its tuning is impossible, or no key sounds.
    """
    drums = isinstance(patch.strings, Drums)
    player = InstrumentPlayer(patch, preset, PREPARED_HZ, {"model": 1.0, "truth": 1.0})
    table = player.table
    assert table is not None
    if not any(_sounds(player.keys, key) for key in range(of.KEYS)):
        raise ValueError(f"{patch.name}: no key sounds with {preset.path}; choose another pick-up")
    header = _Header(magic=b"LSPLUGIN", version=1, modes=min(of.MOST_MODES, player.grid_points - 2) + of.MOST_PAIRS)
    header.most_notes = MOST_NOTES
    whole = bytearray(bytes(header))

    def put(content: bytes) -> int:
        whole.extend(b"\0" * (-len(whole) % 8))
        first = len(whole)
        whole.extend(content)
        return first

    drums_at = int(table.record["drums"])
    kit = kit_of(player.keys) if isinstance(player.keys, DrumKeys) else None
    memory = table.memory[: drums_at or None].copy()  # the shell computes the drums of keys
    record_of(memory, TABLE)["programs"] = 0
    header.table, header.table_slots = put(memory.tobytes()) // 8, len(memory)
    model, truth = table.programs
    header.model, header.model_slots = put(model.tobytes()) // 8, len(model)
    header.truth, header.truth_slots = put(truth.tobytes()) // 8, len(truth)
    taps = differentiator_taps(1) * (FULL_SCALE_M / FULL_SCALE_M_S)
    header.taps = put(taps.tobytes()) // 8
    parameters = list(_parameters(patch))
    header.parameters = put(b"".join(bytes(knob) for _, knob in parameters))
    header.parameter_count = len(parameters)
    ids = tuple(id for id, _ in parameters)
    macros, left_out = _macros(patch, ids)
    header.macros, header.macro_count = put(b"".join(bytes(macro) for macro in macros)), len(macros)
    header.wheel_effect = EFFECTS.index(patch.mod_wheel) if patch.mod_wheel in EFFECTS else -1
    header.wheel_goal = wheel_goal(patch) or 0.0
    header.level_db = patch.level_db

    if kit is not None:
        header.kit = put(kit.memory.tobytes()) // 8
        header.kit_slots = len(kit.memory)
        header.kit_room = kit.room
        header.table_room, header.modes = kit.table_room, kit.modes
    header.body = put(body_of(patch).tobytes()) // 8
    header.longest_s = MOST_LOUD_S
    id = identifier(patch.name)
    header.id = id.encode()
    header.name = _bytes(patch.name, 63)
    header.maker = MAKER.encode()
    header.uid[:] = uuid.uuid5(uuid.NAMESPACE_URL, f"urn:{id}").bytes
    header.description = _bytes(patch.description, 511)
    header.features = f"instrument {'drum' if drums else 'synthesizer'} stereo".encode()
    header.category = patch.category.encode()
    header.bytes = len(whole)
    whole[: ctypes.sizeof(_Header)] = bytes(header)
    controls = (
        Control(id, knob.name.decode(), knob.low, knob.high, knob.standard, tuple(knob.words.decode().split()))
        for id, knob in parameters
    )
    return Image(id, patch.name, bytes(whole), tuple(controls), left_out)


def _sounds(keys: StringKeys | DrumKeys, key: int) -> bool:
    try:
        key_sound = keys.of_key(key)
    except ValueError:
        return False
    return key_sound is not None


def _bytes(text: str, most: int) -> bytes:
    return text.encode()[:most].decode(errors="ignore").encode()


def _id(name: str) -> int:
    """Stable for a name of the table of parameters, below 2³¹ for hosts with signed numbers."""
    return zlib.crc32(name.encode()) & 0x7FFFFFFF


def _record(
    name: str, kind: int, index: int, value: float, parameter: Parameter, module: str, label: str = ""
) -> tuple[str, _Parameter]:
    """The name of a parameter, and its record for the shell."""
    low, high = parameter.limits
    unit = parameter.taper.text.rpartition("}")[2].strip()
    words = [parameter.shown(low + step) for step in range(round(high - low) + 1)] if parameter.whole else []
    return name, _Parameter(
        _id(name),
        kind,
        index,
        len(words),
        low,
        high,
        value,
        parameter.curve,
        _bytes(label or parameter.name, 63),
        _bytes(module, 63),
        _bytes(unit, 15),
        _bytes(" ".join(words), 63),
    )


def _parameters(patch: Patch) -> Iterable[tuple[str, _Parameter]]:
    for number, macro in enumerate(patch.macros):
        id = f"macros.{number}"
        yield _record(id, MACRO, number, macro.value, MACROS[id], "Macros", macro.name)
    yield (
        SOURCE_ID,
        _Parameter(
            _id(SOURCE_ID),
            SOURCE,
            0,
            len(SOURCES),
            0.0,
            2.0,
            0.0,
            1.0,
            b"Source",
            b"",
            b"",
            " ".join(SOURCES).encode(),
        ),
    )
    yield _record("volume_db", VOLUME, 0, 0.0, OF_CHOICES["volume_db"], "")
    drums = isinstance(patch.strings, Drums)
    fixed = not drums and patch.pickup.kind == "bridge"  # at the bridge there is no place to choose
    points = () if fixed else of.PLAYED[of.POINT :][: len(patch.pickup.points)]
    for id in (*WHEELED, *points):
        if id in (DRUM_PARAMETERS if drums else ASSIGNABLE):
            parameter = OF_PATCHES[id]
            yield _record(id, VALUE, of.PLAYED.index(id), patch.value(id), parameter, parameter.group.capitalize())
    for id in effects_there(patch):
        parameter = OF_PATCHES[id]
        yield _record(id, EFFECT, EFFECTS.index(id), patch.value(id), parameter, parameter.group.capitalize())
    for id in AMP:
        parameter = OF_PATCHES[id]
        yield _record(id, AMPLIFIER, AMP.index(id), patch.value(id), parameter, "Amplifier", parameter.name)


def _macros(patch: Patch, ids: tuple[str, ...]) -> tuple[list[_Macro], tuple[str, ...]]:
    """The shell's macros, and the targets that it cannot move."""
    macros, left_out = [], []
    for macro in patch.macros:
        targets = [target for target in macro.targets if target.field in ids]
        left_out += [target.field for target in macro.targets if target.field not in ids]
        record = _Macro(len(targets))
        for place, target in enumerate(targets):
            record.targets[place] = _Target(ids.index(target.field), 0, target.low, target.high)
        macros.append(record)
    return macros, tuple(dict.fromkeys(left_out))


def layout_header(version: str) -> str:
    """The C header with places and constants of the kernels' memory."""
    layout = {
        mixed: "EARLY REACH",
        of: "QUANTUM AHEAD NOTE_ON NOTE_OFF BEND CONTROLLER TUNE PARAMETER TABLE CHOKE ANY EVENTS REPORTS MOST_NOTES "
        "MOST_SOURCES KEYS CHANNELS BEGAN BODY_MIX BODY_SLOTS",
    }
    lines = [f'#define LS_VERSION "{version}"']
    for module, names in layout.items():
        lines += [f"#define {name} {getattr(module, name)}" for name in names.split()]
    for name, kind in (
        ("PLAYER", PLAYER),
        ("EVENT", EVENT),
        ("REPORT", REPORT),
        ("TABLE", TABLE),
        ("RESPONSES", RESPONSES),
        ("NEEDS", NEEDS),
        ("MIXER", mixed.MIXER),
        ("CONVOLVER", mixed.CONVOLVER),
        ("IMPULSE", mixed.IMPULSE),
        ("TENSION_PROGRAM", TENSION_PROGRAM),
        ("TRUTH_PROGRAM", TRUTH_PROGRAM),
    ):
        lines += [f"#define {name}_{field.upper()} {slot(kind, field)}" for field in kind.names or ()]
        lines += [f"#define {name}_SLOTS {slots(kind)}"]
    none = voice_bytes(0) // 8
    records = {"IMAGE": _Header, "PARAMETER": _Parameter, "MACRO": _Macro}
    lines += [f"#define {name}_BYTES {ctypes.sizeof(record)}" for name, record in records.items()]
    lines += [
        f"#define VOICE_SLOTS_FIXED {none}",
        f"#define VOICE_SLOTS_A_MODE {voice_bytes(1) // 8 - none}",
        f"#define BODY_SIZE_HIGHEST {bounds.BODY_SIZE[1]}",
        f"#define ROOM_T60_HIGHEST_S {bounds.ROOM_T60_S[1]}",
        f"#define LIMITER_RELEASE_S {LIMITER_RELEASE_S}",
        f"#define VOLUME_SMOOTHING_S {VOLUME_SMOOTHING_S}",
    ]
    return "\n".join(lines) + "\n"
