"""table: our results with the paper's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from engine.bounds import check_choice
from engine.plain_text import printable
from engine.whole_file import result_file
from training.cli.console import Failure, say

MARKER = "<!-- tables -->"  # all that follows it in a document is made by `table --into`


def table(
    results: Annotated[Path | None, typer.Option(help="The results file; default the project's.")] = None,
    recipe: Annotated[str, typer.Option(help="Only runs of this recipe of training/recipes.")] = "all",
    format: Annotated[
        Literal["compact", "csv"],
        typer.Option(help="compact is Markdown; csv has a line per cell, with deviations and the test split."),
    ] = "compact",
    metric: Annotated[
        Literal["mse", "mae"], typer.Option(help="Relative error of the compact tables; csv has both.")
    ] = "mse",
    output: Annotated[Path | None, typer.Option(help="Write to this file instead of standard output.")] = None,
    into: Annotated[
        Path | None, typer.Option(metavar="FILE.md", help=f"Replace all that follows the line {MARKER} in this file.")
    ] = None,
) -> None:
    """Print the paper's two tables with our results."""
    if into is not None and (format == "csv" or output is not None):
        raise typer.BadParameter("takes Markdown and excludes --output", param_hint="--into")
    from training.cell import recipe_names
    from training.results import RESULTS, read_results
    from training.tables.compact import as_compact
    from training.tables.tidy_csv import as_csv

    check_choice("--recipe", recipe, ("all", *recipe_names()))
    rows = read_results(results or RESULTS)
    if not rows:
        say(f"note: {results or RESULTS} has no rows; the tables hold the paper's figures only")
    text = as_csv(rows, recipe) if format == "csv" else as_compact(rows, recipe, f"rel_{metric}")
    if into is not None:
        text, output = _before(into) + text, into
    if output is None:
        print(printable(text), end="")
        return
    with result_file(output) as file:
        file.write(text.encode())
    print(output)


def _before(document: Path) -> str:
    """A document up to its marker, which is included."""
    kept, marker, _ = document.read_text(encoding="utf-8").partition(f"{MARKER}\n")
    if not marker:
        raise Failure(f"{document}: has no line {MARKER}; put it where the tables are to begin")
    return f"{kept}{marker}\n"
