"""An instrument as one block of bytes, and the header from which the shell has all places in memory.

It holds the sound of an instrument: the table of its keys with their gains, the model's and the solver's
programs, impulse responses of its body and room at several rates, its macros and parameters. Nothing depends on the
rate but the responses: the shell sets it when the host does.
"""

from __future__ import annotations

import ctypes
import uuid
import zlib
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.export.plugin.parts import MIXES, STEPS, levels, mixed, parts_of
from app.instrument.compiled import InstrumentPlayer
from app.instrument.table import VALUES, wheel_goal
from app.patches.patch import Patch
from app.shared.parameters import MACROS, OF_CHOICES, OF_PATCHES, Parameter
from engine.effects.partitions import FADE_S
from engine.kernels import layout as at
from engine.kernels import playing_layout as of
from engine.pluck import FULL_SCALE_M, FULL_SCALE_M_S
from engine.presets import Preset
from engine.voices.derivative import differentiator_taps
from engine.voices.mixer import LIMITER_RELEASE_S, VOLUME_SMOOTHING_S

RATES_HZ = (44_100, 48_000, 96_000)  # of responses; at others they are converted
PREPARED_HZ = 48_000
MAKER = "Learned Strings"
MOST_NOTES = 40
MOST_PARAMETERS, MOST_TARGETS = 64, 8  # of the shell
MOST_LOUD_S = 30.0  # after its last key an instrument may ring on so long
LARGEST_WHOLE = 2**31 - 1
SOURCE, VOLUME, VALUE, POINT, MACRO, MIX = range(6)  # kinds of the shell's parameters
SOURCE_ID = "source"
SOURCES = ("model", "truth", "difference")
FEATURES = {"guitar": "guitar", "bass": "guitar", "keys": "piano"}  # of CLAP, by category


class _Parameter(ctypes.Structure):
    _fields_ = (
        ("id", ctypes.c_uint32),
        ("kind", ctypes.c_int32),
        ("index", ctypes.c_int32),
        ("stepped", ctypes.c_int32),
        ("low", ctypes.c_double),
        ("high", ctypes.c_double),
        ("standard", ctypes.c_double),
        ("name", ctypes.c_char * 64),
        ("module", ctypes.c_char * 64),
        ("unit", ctypes.c_char * 16),
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


class _Part(ctypes.Structure):
    _fields_ = (*((name, ctypes.c_int64) for name in ("frames", "channels", "first")), ("unit", ctypes.c_double))


class _Response(ctypes.Structure):
    _fields_ = (
        ("rate_hz", ctypes.c_int64),
        ("body", _Part),
        ("room", _Part),
        ("powers", ctypes.c_double * 16),
    )


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
                "responses",
                "response_count",
                "levels",
                "level_steps",
                "wheel_mix",
                "modes",
                "most_notes",
            )
        ),
        ("longest_s", ctypes.c_double),
        ("wheel_goal", ctypes.c_double),
        ("id", ctypes.c_char * 128),
        ("name", ctypes.c_char * 64),
        ("description", ctypes.c_char * 512),
        ("maker", ctypes.c_char * 64),
        ("features", ctypes.c_char * 128),
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


def image_of(patch: Patch, preset: Preset) -> Image:
    """The image of an instrument.

    Raises:
        ValueError: its model learned one string only, or its tuning is impossible.
    """
    player = InstrumentPlayer(patch, preset, PREPARED_HZ, {"model": 1.0, "truth": 1.0})
    player.prepare()
    table = player.table
    assert table is not None
    header = _Header(magic=b"LSPLUGIN", version=1, modes=min(of.MOST_MODES, player.grid_points - 2) + of.MOST_PAIRS)
    header.most_notes = MOST_NOTES
    whole = bytearray(bytes(header))

    def put(content: bytes) -> int:
        whole.extend(b"\0" * (-len(whole) % 8))
        first = len(whole)
        whole.extend(content)
        return first

    memory = table.memory.copy()
    memory.view(np.int64)[of.TABLE_PROGRAMS : of.TABLE_PROGRAMS + of.MOST_SOURCES] = 0
    header.table, header.table_slots = put(memory.tobytes()) // 8, len(memory)
    model, truth = table.programs
    header.model, header.model_slots = put(model.tobytes()) // 8, len(model)
    header.truth, header.truth_slots = put(truth.tobytes()) // 8, len(truth)
    taps = differentiator_taps(1) * (FULL_SCALE_M / FULL_SCALE_M_S)
    header.taps = put(taps.tobytes()) // 8
    parameters = list(_parameters(patch))
    header.parameters = put(b"".join(bytes(each) for _, each in parameters))
    header.parameter_count = len(parameters)
    ids = tuple(id for id, _ in parameters)
    macros, left_out = _macros(patch, ids)
    header.macros, header.macro_count = put(b"".join(bytes(each) for each in macros)), len(macros)
    heights = levels(patch, preset.info)
    header.levels, header.level_steps = put(heights.tobytes()) // 4, STEPS
    header.wheel_mix = MIXES.index(patch.mod_wheel) if patch.mod_wheel in MIXES else -1
    header.wheel_goal = wheel_goal(patch) or 0.0

    def part(samples: NDArray[np.float64]) -> _Part:
        unit = (
            float(np.abs(samples).max(initial=0.0)) / LARGEST_WHOLE or 1.0
        )  # where it is loud, finer than single precision
        return _Part(
            len(samples), samples.shape[1], put(np.rint(samples / unit).astype(np.int32).tobytes()) // 4, unit
        )

    records, tail_s = [], 0.0
    for rate_hz in RATES_HZ:
        parts = parts_of(patch, rate_hz)
        if parts is not None:
            record = _Response(rate_hz, part(parts.body), part(parts.room))
            record.powers[:] = parts.powers.ravel().tolist()
            records.append(record)
            tail_s = max(tail_s, (len(parts.body) + len(parts.room)) / rate_hz)
    header.responses, header.response_count = put(b"".join(bytes(each) for each in records)), len(records)
    header.longest_s = tail_s + MOST_LOUD_S
    id = f"org.learned-strings.{''.join(c if c.isalnum() else '-' for c in patch.name.lower())}"
    header.id, header.name, header.maker = id.encode()[:127], _bytes(patch.name, 63), MAKER.encode()
    header.uid[:] = uuid.uuid5(uuid.NAMESPACE_URL, f"urn:{id}").bytes
    header.description = _bytes(patch.description, 511)
    header.features = " ".join(("instrument", "synthesizer", "stereo")).encode()
    header.bytes = len(whole)
    whole[: ctypes.sizeof(_Header)] = bytes(header)
    controls = (
        Control(id, each.name.decode(), each.low, each.high, each.standard, SOURCES if each.stepped else ())
        for id, each in parameters
    )
    return Image(id, patch.name, bytes(whole), tuple(controls), left_out)


def _bytes(text: str, most: int) -> bytes:
    return text.encode()[:most].decode(errors="ignore").encode()


def _id(name: str) -> int:
    """Stable for a name of the table of parameters, below 2³¹ for hosts with signed numbers."""
    return zlib.crc32(name.encode()) & 0x7FFFFFFF


def _record(
    name: str, kind: int, index: int, value: float, parameter: Parameter, module: str, label: str = ""
) -> tuple[str, _Parameter]:
    low, high = parameter.limits
    unit = parameter.taper.text.rpartition("}")[2].strip()
    return name, _Parameter(
        _id(name),
        kind,
        index,
        0,
        low,
        high,
        value,
        _bytes(label or parameter.name, 63),
        _bytes(module, 63),
        _bytes(unit, 15),
    )


def _parameters(patch: Patch) -> Iterable[tuple[str, _Parameter]]:
    for number, macro in enumerate(patch.macros):
        id = f"macros.{number}"
        yield _record(id, MACRO, number, macro.value, MACROS[id], "Macros", macro.name)
    yield SOURCE_ID, _Parameter(_id(SOURCE_ID), SOURCE, 0, 1, 0.0, 2.0, 0.0, b"Source", b"", b"")
    yield _record("volume_db", VOLUME, 0, 0.0, OF_CHOICES["volume_db"], "")
    for index, id in enumerate(VALUES):
        if id in OF_PATCHES:
            yield _record(id, VALUE, index, patch.value(id), OF_PATCHES[id], OF_PATCHES[id].group.capitalize())
    for id in mixed(patch):
        parameter = OF_PATCHES[id]
        yield _record(id, MIX, MIXES.index(id), patch.value(id), parameter, parameter.group.capitalize())
    points = () if patch.pickup.kind == "bridge" else patch.pickup.points  # at the bridge there is no place to choose
    for index, point in enumerate(points):
        id = f"pickup.points.{index}"
        yield _record(id, POINT, index, point, OF_PATCHES[id], OF_PATCHES[id].group.capitalize())


def _macros(patch: Patch, ids: tuple[str, ...]) -> tuple[list[_Macro], tuple[str, ...]]:
    """The shell's macros, and the targets that it cannot move."""
    found, left_out = [], []
    for macro in patch.macros:
        targets = [target for target in macro.targets if target.field in ids]
        left_out += [target.field for target in macro.targets if target.field not in ids]
        record = _Macro(len(targets))
        for place, target in enumerate(targets):
            record.targets[place] = _Target(ids.index(target.field), 0, target.low, target.high)
        found.append(record)
    return found, tuple(dict.fromkeys(left_out))


def layout_header(version: str) -> str:
    """The C header with places and constants of the kernels' memory."""
    wanted = {
        at: "QUANTUM AHEAD EARLY WINDOW REACH MIXER_SLOTS M_RATE M_FRAMES M_ACTIVE M_WANTED_VOLUME M_VOLUME "
        "M_RELEASE M_REDUCTION M_PEAK M_LEFT M_CHANNELS M_SMOOTHING M_LIMITING M_CONVOLVER M_EFFECTS "
        "M_EFFECTS_NOW M_EFFECTS_NEXT M_PLAYER M_TAPS M_GAINS M_HERE I_HEADER C_CAPACITY C_FADE_WINDOWS "
        "C_AWAKE C_STEP C_COSINES C_SINES C_WORK C_LATE S_RATE T_RATE",
        of: "NOTE_ON NOTE_OFF BEND CONTROLLER TUNE PARAMETER TABLE CANCEL CHOKE ANY EVENT_FRAME EVENT_KIND "
        "EVENT_CHANNEL EVENT_KEY EVENT_VALUE EVENT_ID EVENT_POSITION EVENT_PITCH_HZ EVENT_TABLE EVENT_SLOTS "
        "EVENTS REPORTS MOST_NOTES MOST_SOURCES TABLE_MODE TABLE_POINT TABLE_SOURCES TABLE_PROGRAMS MPE KEYS "
        "CHANNELS CHANNEL_SLOTS CHANNEL_RANGE BEND_SEMITONES PLAYER_MOST PLAYER_MODES PLAYER_PUSHED "
        "PLAYER_TAKEN PLAYER_QUEUED PLAYER_REPORTED PLAYER_RATE PLAYER_SOURCE_GAINS PLAYER_VALUES "
        "PLAYER_CHANNELS PLAYER_EVENTS PLAYER_REPORTS PLAYER_VOICES BEGAN REPORT_KIND REPORT_ID "
        "REPORT_CHANNEL REPORT_KEY REPORT_SLOTS TABLE_GAINS GAINS TABLE_LOW TABLE_HIGH PLAYER_WHEEL",
    }
    lines = [f'#define LS_VERSION "{version}"']
    for module, names in wanted.items():
        lines += [f"#define {name} {getattr(module, name)}" for name in names.split()]
    none = of.voice_slots(0)
    lines += [
        f"#define VOICE_SLOTS_FIXED {none}",
        f"#define VOICE_SLOTS_A_MODE {of.voice_slots(1) - none}",
        f"#define CONVOLVER_FADE_S {FADE_S}",
        f"#define LIMITER_RELEASE_S {LIMITER_RELEASE_S}",
        f"#define VOLUME_SMOOTHING_S {VOLUME_SMOOTHING_S}",
    ]
    return "\n".join(lines) + "\n"
