"""table, figure: the results beside the paper's, and figures of presets."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from engine.plain_text import printable
from engine.pluck import DEFAULT_LISTEN
from engine.result_file import whole_file
from training.cli.arguments import check_range, open_preset
from training.cli.console import Failure, progress, say

figure = typer.Typer(help="Draw figures of presets beside the truth, as PNG, SVG or PDF.", no_args_is_help=True)

MARKER = "<!-- tables -->"  # all that follows it in a document is made by `table --into`
LISTEN_RANGE = (0.01, 0.99)


def table(
    results: Annotated[Path | None, typer.Option(help="The results file; default the project's.")] = None,
    recipe: Annotated[
        Literal["ours", "blind", "hinted", "paper", "all"],
        typer.Option(help="Only runs of this recipe of training/recipes."),
    ] = "all",
    format: Annotated[
        Literal["markdown", "csv"], typer.Option(help="csv has a line for each cell (tidy data).")
    ] = "markdown",
    rows: Annotated[
        bool, typer.Option("--rows", help="List the runs behind the figures, with the command that repeats each.")
    ] = False,
    output: Annotated[Path | None, typer.Option(help="Write to this file instead of standard output.")] = None,
    into: Annotated[
        Path | None,
        typer.Option(metavar="FILE.md", help=f"Replace all that follows the line {MARKER} in this file."),
    ] = None,
) -> None:
    """Print the paper's two tables with our results beside its figures."""
    if rows and format == "csv":
        raise typer.BadParameter("is for markdown; in CSV each line names its runs", param_hint="--rows")
    if into is not None and (format == "csv" or output is not None):
        raise typer.BadParameter("takes Markdown, and goes without --output", param_hint="--into")
    from training.results import RESULTS, read_results
    from training.tables.markdown import as_markdown
    from training.tables.tidy_csv import as_csv

    found = read_results(results or RESULTS)
    if not found:
        say(f"note: {results or RESULTS} has no rows; the tables hold the paper's figures only")
    text = as_csv(found, recipe) if format == "csv" else as_markdown(found, recipe, listing=rows)
    if into is not None:
        text, output = _before(into) + text, into
    if output is None:
        print(printable(text), end="")
        return
    with whole_file(output) as file:
        file.write(text.encode())
    print(output)


def _before(document: Path) -> str:
    """A document up to its marker, which is included."""
    kept, marker, _ = document.read_text(encoding="utf-8").partition(f"{MARKER}\n")
    if not marker:
        raise Failure(f"{document}: has no line {MARKER}; put it where the tables are to begin")
    return f"{kept}{marker}\n"


@figure.command()
def extrapolation(
    presets: Annotated[
        list[str], typer.Argument(metavar="PRESET...", help="Names of presets or paths of their files.")
    ],
    seconds: Annotated[
        float | None, typer.Option(metavar="S", help="Time shown, in s; default twice the training horizon.")
    ] = None,
    trajectory: Annotated[int, typer.Option(min=0, help="Number of the trajectory in the validation set.")] = 0,
    trajectories: Annotated[
        int, typer.Option(min=1, help="How many of the validation set the error is taken over, from the first on.")
    ] = 10,
    listen: Annotated[
        float, typer.Option(metavar="X", help="Listening point, 0 … 1 of the length; 0.37 is the paper's 24 cm.")
    ] = DEFAULT_LISTEN,
    output: Annotated[
        Path | None,
        typer.Option(help="The file; its suffix gives the format. Default extrapolation.png in this folder."),
    ] = None,
) -> None:
    """Figure 3 of the paper: past the training horizon.

    Waveforms, spectra and errors, up to the horizon and past it.
    """
    from training.figures import extrapolation as drawing
    from training.figures.style import check_format, figure_bytes

    check_range("--listen", listen, *LISTEN_RANGE)
    if seconds is not None:
        check_range("--seconds", seconds, 0, drawing.LONGEST_S, "s")
    path = output or Path("extrapolation.png")
    try:
        check_format(path)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--output") from error
    loaded = [open_preset(name) for name in presets]
    with whole_file(path) as file, progress("figure extrapolation") as report:
        drawn = drawing.extrapolation(loaded, seconds, trajectory, trajectories, listen, report)
        file.write(figure_bytes(drawn, path.suffix))
    print(path)
