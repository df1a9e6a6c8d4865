"""Options that several commands share, and the checks of their ranges (exit status 2)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from engine.bounds import SIZES

if TYPE_CHECKING:
    from engine.presets import Preset

PresetName = Annotated[str, typer.Argument(metavar="PRESET", help="A preset's name or the path of its file.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Cache = Annotated[
    Path | None,
    typer.Option(help="Folder of the data sets; default LEARNED_STRINGS_CACHE, else cache in the project's folder."),
]
Runs = Annotated[
    Path | None,
    typer.Option(
        help="Folder of runs, each with its checkpoint and log.csv; default LEARNED_STRINGS_RUNS, else runs in the "
        "project's folder."
    ),
]
Device = Literal["cpu", "cuda", "auto"]

StringName = Annotated[
    str | None,
    typer.Option(
        "--string",
        metavar="NAME|STRING.toml",
        help="For a preset of many strings: the string, by name (nylon_b3) or as a file of its parameters.",
    ),
]
StringRate = Annotated[
    int | None,
    typer.Option("--rate", metavar="HZ", help="For a preset of many strings: sample rate; default its own."),
]
StringModes = Annotated[
    int | None,
    typer.Option(
        "--modes",
        min=1,
        max=SIZES["modes"][1],
        metavar="M",
        help="For a preset of many strings: number of modes; default all below 20 kHz.",
    ),
]


def check_range(option: str, value: float, low: float, high: float, unit: str = "") -> None:
    """Check that low ≤ value ≤ high.

    Raises:
        typer.BadParameter: it is not: the command ends with exit status 2 and names option, value and range.
    """
    if not low <= value <= high:
        text = f" {unit}" if unit else ""
        raise typer.BadParameter(f"must lie in {low:.10g} … {high:.10g}{text}, not {value:.10g}", param_hint=option)


def check_suffix(option: str, path: Path, *suffixes: str) -> None:
    """Raise typer.BadParameter: the name of a file that is written ends with none of `suffixes`."""
    if path.suffix.lower() not in suffixes:
        words = " or ".join(suffixes)
        raise typer.BadParameter(f"must end with {words}, not {path.suffix or 'nothing'}", param_hint=option)


def open_preset(name_or_path: str) -> Preset:
    """Load a preset by its name, of the shipped ones and the user's own, or by its path. Raises PresetError."""
    from engine.folders import usable_files
    from engine.presets import find_preset, load_preset

    return load_preset(find_preset(name_or_path, usable_files()))


def open_preset_of_string(
    name_or_path: str,
    string: str | None,
    rate_hz: int | None = None,
    modes: int | None = None,
    *,
    to_render: bool = False,
) -> Preset:
    """Load a preset, and choose string, rate and number of modes of one of many strings; None: the preset's own.

    Args:
        to_render: `rate_hz` is of what is rendered; presets of one string keep their own.

    Raises:
        PresetError, SchemaError: there is no such preset or string, or the preset is not of many strings.
    """
    from engine.presets import PresetError, find_string, of_string, read_string

    if rate_hz is not None and not to_render:
        check_range("--rate", rate_hz, 1_000, 1_000_000, "Hz")
    loaded = open_preset(name_or_path)
    if to_render and loaded.info.family is None:
        rate_hz = None
    if string is None:
        return of_string(loaded, None, rate_hz, modes)
    file = find_string(string)
    parameters = read_string(file)
    try:
        return of_string(loaded, parameters, rate_hz, modes)
    except PresetError as error:
        raise PresetError(f"{file}: {error}") from error
