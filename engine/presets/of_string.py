"""A preset of many strings, of one that is given: by its physical parameters, at any rate, with any modes."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace
from pathlib import Path

from engine.models.base import Physics
from engine.presets.file import Preset, PresetError
from engine.presets.finding import SHIPPED
from engine.resonators.string import StringParameters
from engine.schema import SchemaError, read

HIGHEST_HZ = 20_000.0  # modes above are not heard
LARGEST_FILE_BYTES = 65_536
STRINGS = SHIPPED / "strings"
MOST_MODES_COUNTED = 10_000


def read_string(path: Path) -> StringParameters:
    """The string of a TOML file: its eight parameters at top level, as `[data.string]` of a configuration has them.

    Raises:
        SchemaError: no TOML, a field that is unknown or impossible; the message names file, field and remedy.
        OSError: the file cannot be read.
    """
    with path.open("rb") as file:
        data = file.read(LARGEST_FILE_BYTES + 1)
    if len(data) > LARGEST_FILE_BYTES:
        raise SchemaError(f"{path}: is larger than the {LARGEST_FILE_BYTES} bytes that a string may have")
    try:
        fields = tomllib.loads(data.decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError, ValueError) as error:
        raise SchemaError(f"{path}: not valid TOML: {error}") from error
    return read(StringParameters, fields, str(path))


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
    info = preset.info
    name = f"{preset.path}: string"
    chosen, rate = string or info.string, rate_hz or info.rate_hz
    highest_hz = min(HIGHEST_HZ, rate / 2)
    if modes is None:
        modes = min(_modes_below(chosen, highest_hz), info.grid_points - 2)
    if modes < 1:
        raise PresetError(f"{name}: it has no mode below {highest_hz:g} Hz; lower its tension, or make it longer")
    try:
        told = replace(
            info,
            string=chosen,
            rate_hz=rate,
            modes=modes,
            horizon_steps=max(1, round(info.horizon_s * rate)),
            model_configuration={**info.model_configuration, "modes": modes},
        )
        model = preset.model.tuned(Physics(told.resonator, rate, info.scale_m))
    except ValueError as error:
        raise PresetError(f"{name}: {error}") from error
    return replace(preset, info=told, model=model.eval())


def _modes_below(string: StringParameters, frequency_hz: float) -> int:
    """In closed form: EIη⁴ + T₀η² = ρA (2πf)² is quadratic in η²."""
    bending = string.youngs_modulus_pa * string.second_moment_m4
    square = string.mass_per_length_kg_m * (2 * math.pi * frequency_hz) ** 2
    eta_squared = 2 * square / (string.tension_n + math.sqrt(string.tension_n**2 + 4 * bending * square))
    count = math.sqrt(eta_squared) * string.length_m / math.pi
    if not math.isfinite(count):
        return MOST_MODES_COUNTED
    return min(MOST_MODES_COUNTED, math.ceil(count) - 1)
