"""Options that several commands share, and the checks of their ranges (exit status 2)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from engine.pluck import Pluck
    from engine.preset import Preset

PresetName = Annotated[str, typer.Argument(metavar="PRESET", help="A preset's name or the path of its file.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Cache = Annotated[Path | None, typer.Option(help="Folder of the data sets; made where it is not there.")]

Position = Annotated[float, typer.Option(help="Where to pluck: 0 and 1 are the fixed ends, 0.5 the middle.")]
AmplitudeMm = Annotated[float, typer.Option(help="Peak displacement in mm.")]
Seconds = Annotated[float, typer.Option(help="Duration in s.")]
ShapeName = Literal["gaussian", "triangular", "raised_cosine"]  # engine.pluck.Shape, known without torch
Shape = Annotated[ShapeName, typer.Option(help="The pluck's shape.")]
Width = Annotated[float, typer.Option(help="Width of the pluck in lengths of the string.")]
# the defaults of engine.pluck.Pluck
DEFAULT_SHAPE: ShapeName = "gaussian"
DEFAULT_WIDTH = 0.06


def check_range(option: str, value: float, low: float, high: float, unit: str = "") -> None:
    """Ends the command with exit status 2 and a message that names the option, its value and its range."""
    if not low <= value <= high:
        text = f" {unit}" if unit else ""
        raise typer.BadParameter(f"must lie in {low:.10g} … {high:.10g}{text}, not {value:.10g}", param_hint=option)


def check_pluck(position: float, amplitude_mm: float, shape: ShapeName, width: float) -> Pluck:
    """The pluck, its options checked."""
    from engine.pluck import LARGEST_AMPLITUDE_MM, POSITION_RANGE, WIDTH_RANGE, Pluck

    check_range("--position", position, *POSITION_RANGE)
    check_range("--amplitude-mm", amplitude_mm, 0, LARGEST_AMPLITUDE_MM, "mm")
    check_range("--width", width, *WIDTH_RANGE)
    return Pluck(position, amplitude_mm, shape, width)


def open_preset(name_or_path: str) -> Preset:
    """The preset of a name or a path. Raises PresetError."""
    from engine.preset import find_preset, load_preset

    return load_preset(find_preset(name_or_path))
