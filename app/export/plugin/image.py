"""An instrument as one block of bytes, which the shell reads.

It holds the table of an instrument's keys with their gains, the programs of model and solver, the modes of its
body, macros and parameters. Nothing depends on the rate, which the shell sets when
the host does. The responses of body and room are computed then.
"""

from __future__ import annotations

import uuid
import zlib
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.export.plugin.identity import identifier
from app.export.plugin.layout import IMAGE, KINDS, MACRO, MOST_PARAMETERS, PARAMETER, SOURCES
from app.export.plugin.parts import AMP, EFFECTS, body_of, kit_of
from app.instruments.drums import Drums
from app.instruments.instrument import ASSIGNABLE, Instrument
from app.player.compiled import InstrumentPlayer
from app.player.drum_keys import DrumKeys
from app.player.strings import StringKeys
from app.player.table import WHEELED, wheel_goal
from app.shared.parameters import MACROS, OF_CHOICES
from engine.effects.room import NOISE_FRAMES
from engine.kernels import constants as of
from engine.kernels.fields import record_of
from engine.kernels.records import TABLE
from engine.levels import FULL_SCALE_M, FULL_SCALE_M_S
from engine.parameters import OF_INSTRUMENTS, PLACE, PLAYED, Parameter
from engine.presets import Preset
from engine.voices.ear import differentiator_taps

PREPARED_HZ = 48_000
MAKER = "Learned Strings"
MOST_NOTES = 40
MOST_LOUD_S = 30.0  # after its last key an instrument may ring on so long
NOISE_BYTES = 8  # of a frame of the rooms' noise
SOURCE = Parameter("source", "Source", (0.0, 2.0), 0.0, PLACE, words=SOURCES)


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


def image_of(instrument: Instrument, preset: Preset) -> Image:
    """The image of an instrument.

    Raises:
        ValueError: its model learned one string only, its tuning is impossible, or no key sounds.
    """
    player = InstrumentPlayer(instrument, preset, PREPARED_HZ, {"model": 1.0, "truth": 1.0})
    table = player.table
    assert table is not None
    if not any(_sounds(player.keys, key) for key in range(of.KEYS)):
        raise ValueError(f"{instrument.name}: no key sounds with {preset.path}; choose another pick-up")
    header = np.zeros((), IMAGE)
    header["modes"] = min(of.MOST_MODES, player.grid_points - 2) + of.MOST_PAIRS
    header["most_notes"] = MOST_NOTES
    whole = bytearray(header.tobytes())

    def put(content: bytes) -> int:
        """Append bytes at a multiple of 8; return the place of the first."""
        whole.extend(b"\0" * (-len(whole) % 8))
        first = len(whole)
        whole.extend(content)
        return first

    drums_at = int(table.record["drums"])
    kit = kit_of(player.keys) if isinstance(player.keys, DrumKeys) else None
    memory = table.memory[: drums_at or None].copy()  # the shell computes the drums of keys
    record_of(memory, TABLE)["programs"] = 0
    model, truth = table.programs
    for name, part in (("table", memory), ("model", model), ("truth", truth)):
        header[name], header[f"{name}_slots"] = put(part.tobytes()) // 8, len(part)
    taps = differentiator_taps(1) * (FULL_SCALE_M / FULL_SCALE_M_S)
    header["taps"] = put(taps.tobytes()) // 8
    parameters = dict(_parameters(instrument))
    assert len(parameters) <= MOST_PARAMETERS
    header["parameters"] = put(b"".join(knob.tobytes() for knob in parameters.values()))
    header["parameter_count"] = len(parameters)
    macros, left_out = _macros(instrument, tuple(parameters))
    header["macros"], header["macro_count"] = put(macros.tobytes()), len(macros)
    header["wheel_effect"] = EFFECTS.index(instrument.mod_wheel) if instrument.mod_wheel in EFFECTS else -1
    header["wheel_goal"] = wheel_goal(instrument) or 0.0
    header["level_db"] = instrument.level_db
    if kit is not None:
        header["kit"], header["kit_slots"] = put(kit.memory.tobytes()) // 8, len(kit.memory)
        header["kit_room"] = kit.room
        header["table_room"] = kit.table_room
        header["modes"] = kit.modes
    header["body"] = put(body_of(instrument).tobytes()) // 8
    header["longest_s"] = MOST_LOUD_S
    id = identifier(instrument.name)
    header["id"] = id.encode()
    header["name"] = _bytes(instrument.name, 63)
    header["maker"] = MAKER.encode()
    header["uid"] = np.frombuffer(uuid.uuid5(uuid.NAMESPACE_URL, f"urn:{id}").bytes, np.uint8)
    header["description"] = _bytes(instrument.description, 511)
    header["category"] = instrument.category.encode()
    whole[: IMAGE.itemsize] = header.tobytes()
    controls = tuple(_control(name, knob) for name, knob in parameters.items())
    return Image(id, instrument.name, bytes(whole), controls, left_out)


def _control(id: str, knob: np.void) -> Control:
    low, high, standard = knob[["low", "high", "standard"]].item()
    return Control(id, knob["name"].decode(), low, high, standard, tuple(knob["words"].decode().split()))


def _sounds(keys: StringKeys | DrumKeys, key: int) -> bool:
    try:
        key_sound = keys.of_key(key)
    except ValueError:
        return False
    return key_sound is not None


def _bytes(text: str, most: int) -> bytes:
    """A text as UTF-8, cut after a whole character to so many bytes."""
    return text.encode()[:most].decode(errors="ignore").encode()


def _record(
    kind: str, index: int, value: float, parameter: Parameter, module: str = "", label: str = ""
) -> tuple[str, np.void]:
    """The identifier of a parameter, and its record for the shell.

    Args:
        kind: one of `layout.KINDS`.
        index: of the parameter among those of its kind.
        value: its standard value, the instrument's own.
        module: the group in which hosts list it; "": none.
        label: its name for hosts; "": the table's.
    """
    low, high = parameter.limits
    words = [parameter.shown(low + step) for step in range(round(high - low) + 1)] if parameter.whole else []
    record = np.zeros(1, PARAMETER)[0]
    record["id"] = zlib.crc32(parameter.id.encode()) & 0x7FFFFFFF  # stable; below 2³¹ for hosts with signed numbers
    record["kind"] = KINDS.index(kind)
    record["index"] = index
    record["steps"] = len(words)
    record["low"] = low
    record["high"] = high
    record["standard"] = value
    record["curve"] = parameter.curve
    record["name"] = _bytes(label or parameter.name, 63)
    record["module"] = _bytes(module, 63)
    record["unit"] = _bytes(parameter.taper.text.rpartition("}")[2].strip(), 15)
    record["words"] = _bytes(" ".join(words), 63)
    return parameter.id, record


def _parameters(instrument: Instrument) -> Iterable[tuple[str, np.void]]:
    """Identifier and record of each parameter that hosts see, in the shell's order: see `_record`."""
    for number, macro in enumerate(instrument.macros):
        yield _record("macro", number, macro.value, MACROS[f"macros.{number}"], "Macros", macro.name)
    yield _record("source", 0, 0.0, SOURCE)
    yield _record("volume", 0, 0.0, OF_CHOICES["volume_db"])
    drums = isinstance(instrument.strings, Drums)
    fixed = not drums and instrument.pickup.kind == "bridge"  # at the bridge there is no place to choose
    points = () if fixed else PLAYED[of.VALUE.pickup_points_0 :][: len(instrument.pickup.points)]
    followed = [id for id in (*WHEELED, *points) if (OF_INSTRUMENTS[id].drums if drums else id in ASSIGNABLE)]
    heard = [id for id in EFFECTS if instrument.body.name or not id.startswith("body.")]
    for kind, ids, order in (
        ("value", followed, PLAYED),
        ("effect", heard, EFFECTS),
        ("amp", AMP, AMP),
    ):
        for id in ids:
            parameter = OF_INSTRUMENTS[id]
            module = "Amplifier" if kind == "amp" else parameter.group.capitalize()
            yield _record(kind, order.index(id), instrument.value(id), parameter, module)


def _macros(instrument: Instrument, ids: tuple[str, ...]) -> tuple[NDArray[np.void], tuple[str, ...]]:
    """The shell's macros, and the targets that it cannot move."""
    macros = np.zeros(len(instrument.macros), MACRO)
    for record, macro in zip(macros, instrument.macros, strict=True):
        targets = [target for target in macro.targets if target.field in ids]
        record["count"] = len(targets)
        for place, target in enumerate(targets):
            record["targets"][place] = ids.index(target.field), 0, target.low, target.high
    left_out = (target.field for macro in instrument.macros for target in macro.targets if target.field not in ids)
    return macros, tuple(dict.fromkeys(left_out))
