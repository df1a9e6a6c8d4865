"""A preset for one string, from a preset of many: by its physical parameters, at any rate, with any modes.

The TOML files that hold these parameters, of strings and of drums, are read here too.
"""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import TypeVar

from engine.presets.file import Preset, PresetError, arrays_of
from engine.presets.finding import SHIPPED
from engine.presets.info import PresetInfo
from engine.schema import SchemaError, read, read_toml
from engine.values.drum import DrumParameters
from engine.values.string import StringParameters

HIGHEST_HZ = 20_000.0  # modes above are not heard
STRINGS = SHIPPED / "strings"
T = TypeVar("T")


def read_string(path: Path) -> StringParameters:
    """The string of a TOML file; see `read_described_string`."""
    return read_described_string(path)[0]


def read_drum(path: Path) -> tuple[DrumParameters, str]:
    """The drum of a TOML file, and its `description`; as `read_described_string`."""
    return _read_described(DrumParameters, path, "a drum")


def read_described_string(path: Path) -> tuple[StringParameters, str]:
    """The string of a TOML file, and its `description` in one line, "" where the file has none.

    Its eight parameters stand at top level, as `[data.string]` of a configuration has them. All must be given: a
    string that is named by its file is not that of the paper where the file is silent.

    Raises:
        SchemaError: see `read_toml`; a field is unknown, impossible or missing: the message names file,
            field and remedy.
        OSError: the file cannot be read.
    """
    return _read_described(StringParameters, path, "a string")


def _read_described(kind: type[T], path: Path, noun: str) -> tuple[T, str]:
    """Read parameters of which none may be missing, and their description. `noun`: what they are, in messages."""
    data = read_toml(path)
    description = data.pop("description", "")
    if not isinstance(description, str):
        raise SchemaError(f"{path}: description must be a text; put it in quotes")
    value = read(kind, data, str(path))
    names = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    if missing := [name for name in names if name not in data]:
        raise SchemaError(
            f"{path}: {', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing; "
            f"{noun}'s file gives all of {', '.join(names)}"
        )
    return value, " ".join(description.split())


def find_string(name_or_path: str) -> Path:
    """The file of a string by its name among the shipped ones, or by path.

    Raises:
        PresetError: there is none; the message lists the names.
    """
    by_name = {path.stem: path for path in STRINGS.glob("*.toml")}
    path = by_name.get(name_or_path, Path(name_or_path))
    if not path.is_file():
        raise PresetError(f"no string {name_or_path!r}; give a .toml file or one of: {', '.join(sorted(by_name))}")
    return path


def of_string(
    preset: Preset, string: StringParameters | None = None, rate_hz: int | None = None, modes: int | None = None
) -> Preset:
    """The preset with another string, rate or number of modes; unchanged where all are None.

    Args:
        modes: None: all below 20 kHz and half the rate, as many as the grid holds.

    Raises:
        PresetError: the model learned one string; or the string has no such modes, or is overdamped.
    """
    if string is None and rate_hz is None and modes is None:
        return preset
    try:
        if not preset.info.of_many_strings:
            raise ValueError("its model knows the one string that it learned; choose a preset of many strings")
        info = info_of_string(preset.info, string, rate_hz, modes)
        weights = {**preset.weights, **arrays_of(info)}
    except (ValueError, OverflowError) as error:
        raise PresetError(f"{preset.path}: string: {error}") from error
    return replace(preset, info=info, weights=weights)


def info_of_string(
    info: PresetInfo, string: StringParameters | None = None, rate_hz: int | None = None, modes: int | None = None
) -> PresetInfo:
    """The description that a preset of many strings has for one; arguments as of `of_string`.

    Raises:
        ValueError: the string has no such modes, or its motion is beyond what is computed.
    """
    chosen, rate = string or info.string, rate_hz or info.rate_hz
    highest_hz = min(HIGHEST_HZ, rate / 2)
    if modes is None:
        modes = min(chosen.modes_below(highest_hz), info.grid_points - 2)
    if modes < 1:
        raise ValueError(f"it has no mode below {highest_hz:g} Hz; lower its tension, or make it longer")
    return replace(
        info,
        string=chosen,
        rate_hz=rate,
        modes=modes,
        horizon_steps=max(1, round(info.horizon_s * rate)),
        model_configuration={**info.model_configuration, "modes": modes},
    )
