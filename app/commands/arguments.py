"""Options that several commands share, and the checks of their ranges (exit status 2)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from engine import pluck as plucks

if TYPE_CHECKING:
    from engine.presets import Preset

PresetName = Annotated[str, typer.Argument(metavar="PRESET", help="A preset's name or the path of its file.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Cache = Annotated[Path | None, typer.Option(help="Folder of the data sets; made where it is not there.")]

StringName = Annotated[
    str | None,
    typer.Option(
        "--string",
        metavar="NAME|STRING.toml",
        help="For a preset of many strings: another one, by name, or a file of a configuration's [data.string].",
    ),
]
StringRate = Annotated[
    int | None, typer.Option("--rate", metavar="HZ", help="For a preset of many strings: another sample rate.")
]
StringModes = Annotated[
    int | None,
    typer.Option("--modes", min=1, metavar="M", help="And so many modes; default all below 20 kHz."),
]

POSITION_HELP = "Where to pluck: 0 and 1 are the fixed ends, 0.5 the middle."
AMPLITUDE_HELP = "Peak displacement in mm."
SECONDS_HELP = "Duration in s."
Position = Annotated[float, typer.Option(help=POSITION_HELP)]
AmplitudeMm = Annotated[float, typer.Option(help=AMPLITUDE_HELP)]
Seconds = Annotated[float, typer.Option(help=SECONDS_HELP)]
Shape = Annotated[plucks.Shape, typer.Option(help="The pluck's shape.")]
Width = Annotated[float, typer.Option(help="Width of the pluck in lengths of the string.")]
DEFAULT_SHAPE = plucks.Pluck().shape
DEFAULT_WIDTH = plucks.Pluck().width


def check_range(option: str, value: float, low: float, high: float, unit: str = "") -> None:
    """Ends the command with exit status 2 and a message that names the option, its value and its range."""
    if not low <= value <= high:
        text = f" {unit}" if unit else ""
        raise typer.BadParameter(f"must lie in {low:.10g} … {high:.10g}{text}, not {value:.10g}", param_hint=option)


def check_pluck(position: float, amplitude_mm: float, shape: plucks.Shape, width: float) -> plucks.Pluck:
    """The pluck, its options checked."""
    check_range("--position", position, *plucks.POSITION_RANGE)
    check_range("--amplitude-mm", amplitude_mm, 0, plucks.LARGEST_AMPLITUDE_MM, "mm")
    check_range("--width", width, *plucks.WIDTH_RANGE)
    return plucks.Pluck(position, amplitude_mm, shape, width)


def open_preset(name_or_path: str) -> Preset:
    """The preset of a name (the user's own among them) or a path. Raises PresetError."""
    from app.presets.folders import usable_files
    from engine.presets import find_preset, load_preset

    return load_preset(find_preset(name_or_path, usable_files()))


def open_preset_of_string(
    name_or_path: str, string: str | None, rate_hz: int | None = None, modes: int | None = None
) -> Preset:
    """The same, of the string of a file, at a rate, with so many modes; None: the preset's own.

    Raises:
        PresetError, SchemaError: no such preset or string; or the preset is of one string.
    """
    if rate_hz is not None:
        check_range("--rate", rate_hz, 1_000, 1_000_000, "Hz")
    return _of_string(open_preset(name_or_path), string, rate_hz, modes)


def open_preset_to_render(name_or_path: str, string: str | None, rate_hz: int | None, modes: int | None) -> Preset:
    """The same for a sound file of a rate: a model of many strings plays at it, any other at its own.

    Raises:
        As `open_preset_of_string`.
    """
    loaded = open_preset(name_or_path)
    return _of_string(loaded, string, None if loaded.info.family is None else rate_hz, modes)


def _of_string(loaded: Preset, string: str | None, rate_hz: int | None, modes: int | None) -> Preset:
    from engine.presets import PresetError, find_string, of_string, read_string

    if string is None:
        return of_string(loaded, None, rate_hz, modes)
    file = find_string(string)
    parameters = read_string(file)
    try:
        return of_string(loaded, parameters, rate_hz, modes)
    except PresetError as error:
        raise PresetError(f"{file}: {error}") from error
