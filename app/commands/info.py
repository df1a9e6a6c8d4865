"""Command `info`: the origin of a sound file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from engine.plain_text import duration, one_line
from training.cli.arguments import Json
from training.cli.console import print_json, say


def info(
    file: Annotated[Path, typer.Argument(metavar="FILE.wav", help="A file that render, batch or the app wrote.")],
    json: Json = False,
) -> None:
    """Show what a WAV or FLAC file is: the recipe of a pluck, or what was played on an instrument.

    `render --recipe FILE.wav` renders a pluck again, `play FILE.mid` what was played.
    """
    from app.export.recipe import RecipeError, SoundRecipe, preset_of, read_origin
    from engine.folders import usable_files

    origin = read_origin(file)
    facts = origin.model_dump(mode="json")
    try:
        path, exact = preset_of(origin, usable_files())
        preset_file = f"{path}" if exact else f"{path} (another version of it)"
    except RecipeError:
        preset_file = "none; the preset is not here"
    if json:
        print_json({**facts, "preset_file": preset_file})
        return
    parts = {part: of_part for part, of_part in facts.items() if isinstance(of_part, dict)}
    part_values = {f"{part} {name}": value for part, of_part in parts.items() for name, value in of_part.items()}
    plain = {name: value for name, value in facts.items() if name not in parts}
    lines = {**part_values, **plain, "preset file": preset_file}
    width = max(map(len, lines))
    for name, value in lines.items():
        print(f"{name.replace('_', ' '):<{width}}  {'-' if value is None else one_line(str(value))}")
    if not isinstance(origin, SoundRecipe):
        say(f"note: {one_line(origin.words)}")
    elif origin.source != "truth" and (origin.settings.decay_db is not None or origin.seconds > origin.horizon_s):
        say(f"note: from {duration(origin.horizon_s)} on, the model is past its training")
