"""info: the recipe in a WAV file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from engine.plain_text import one_line
from training.cli.arguments import Json
from training.cli.console import print_json, say


def info(
    file: Annotated[Path, typer.Argument(metavar="FILE.wav", help="A file that render, batch or the app wrote.")],
    json: Json = False,
) -> None:
    """Show the recipe of a WAV file.

    `render --recipe FILE.wav` renders it again.
    """
    from app.export.recipe import RecipeError, preset_of, read_recipe
    from engine.folders import usable_files

    recipe = read_recipe(file)
    facts = recipe.model_dump(mode="json")
    try:
        path, exact = preset_of(recipe, usable_files())
        here = f"{path}" if exact else f"{path} (another version of it)"
    except RecipeError:
        here = "none; the preset is not here"
    if json:
        print_json({**facts, "preset_file": here})
        return
    parts = {part: facts.pop(part) or {} for part in ("pluck", "string")}
    told = {f"{part} {name}": value for part, of_part in parts.items() for name, value in of_part.items()}
    lines = {**told, **facts, "preset file": here}
    width = max(map(len, lines))
    for name, value in lines.items():
        print(f"{name.replace('_', ' '):<{width}}  {'-' if value is None else one_line(str(value))}")
    if recipe.source != "truth" and (recipe.decay_db is not None or recipe.seconds > recipe.horizon_s):
        say(f"note: from {recipe.horizon_s:g} s on, the model is past its training")
