"""table, figure: the results beside the paper's, and pictures of presets."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from app.commands.arguments import check_range, open_preset
from app.commands.console import Failure, progress, say
from app.shared.whole_file import whole_file
from engine.pluck import DEFAULT_LISTEN

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from app.commands.console import Report
    from engine.presets import Preset

figure = typer.Typer(help="Draw presets beside the truth: PNG, SVG or PDF.", no_args_is_help=True)

PresetNames = Annotated[
    list[str], typer.Argument(metavar="PRESET...", help="Names of presets or paths of their files.")
]
Trajectory = Annotated[int, typer.Option(min=0, help="Which one of the validation set.")]
Listen = Annotated[float, typer.Option(help="Listening point in lengths of the string; 0.37 is the paper's 24 cm.")]
Output = Annotated[Path | None, typer.Option(help="The file; its suffix is the format. Default: FIGURE.png, here.")]
MARKER = "<!-- tables -->"  # all that follows it in a document is made by `table --into`
LISTEN_RANGE = (0.01, 0.99)


def table(
    results: Annotated[Path | None, typer.Option(help="The results file; default the project's.")] = None,
    recipe: Annotated[
        Literal["ours", "blind", "hinted", "paper", "all"], typer.Option(help="Whose recipe the runs followed.")
    ] = "all",
    format: Annotated[Literal["markdown", "csv"], typer.Option(help="csv is tidy: a line a cell.")] = "markdown",
    rows: Annotated[
        bool, typer.Option("--rows", help="List the runs behind the figures, with the command that repeats each.")
    ] = False,
    output: Annotated[Path | None, typer.Option(help="A file in place of standard output.")] = None,
    into: Annotated[
        Path | None, typer.Option(metavar="FILE.md", help=f"Put them into a file, in place of all after {MARKER}.")
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
        print(text, end="")
        return
    with whole_file(output) as file:
        file.write(text.encode())
    print(output)


def _before(document: Path) -> str:
    """What stands in a document up to its marker, and the marker."""
    kept, marker, _ = document.read_text(encoding="utf-8").partition(f"{MARKER}\n")
    if not marker:
        raise Failure(f"{document}: has no line {MARKER}; put it where the tables shall begin")
    return f"{kept}{marker}\n"


@figure.command()
def evolution(
    presets: PresetNames,
    trajectory: Trajectory = 0,
    seconds: Annotated[float, typer.Option(help="From the start on.")] = 0.1,
    listen: Listen = DEFAULT_LISTEN,
    output: Output = None,
) -> None:
    """Displacement of the whole string over time, errors, and spectra (the paper's Fig. 2)."""
    from training.figures import evolution as drawing

    check_range("--listen", listen, *LISTEN_RANGE)
    check_range("--seconds", seconds, 0, drawing.LONGEST_S, "s")
    _write(
        presets,
        output,
        "evolution",
        lambda loaded, report: drawing.evolution(loaded, trajectory, seconds, listen, report),
    )


@figure.command()
def extrapolation(
    presets: PresetNames,
    seconds: Annotated[float | None, typer.Option(help="Default: twice the training horizon.")] = None,
    trajectory: Trajectory = 0,
    trajectories: Annotated[int, typer.Option(min=1, help="Of the validation set, for the common error.")] = 10,
    listen: Listen = DEFAULT_LISTEN,
    output: Output = None,
) -> None:
    """Waveforms, spectra and errors before and past the end of training (the paper's Fig. 3)."""
    from training.figures import extrapolation as drawing

    check_range("--listen", listen, *LISTEN_RANGE)
    if seconds is not None:
        check_range("--seconds", seconds, 0, drawing.LONGEST_S, "s")
    _write(
        presets,
        output,
        "extrapolation",
        lambda loaded, report: drawing.extrapolation(loaded, seconds, trajectory, trajectories, listen, report),
    )


@figure.command()
def error(
    presets: PresetNames,
    seconds: Annotated[float | None, typer.Option(help="Default: one and a half times the training horizon.")] = None,
    trajectories: Annotated[
        int | None, typer.Option(min=1, help="Of the validation set, from the first on; default all.")
    ] = None,
    output: Output = None,
) -> None:
    """Relative error in each time step, over the validation set (the paper's Fig. 4)."""
    from training.figures import error as drawing

    if seconds is not None:
        check_range("--seconds", seconds, 0, drawing.LONGEST_S, "s")
    _write(presets, output, "error", lambda loaded, report: drawing.error(loaded, seconds, trajectories, report))


@figure.command()
def eigenvalues(presets: PresetNames, output: Output = None) -> None:
    """Learned eigenvalues in the unit circle, decay rates over frequency, beside the linear string's."""
    from training.figures import eigenvalues as drawing

    _write(presets, output, "eigenvalues", lambda loaded, report: drawing.eigenvalues(loaded))


def _write(names: list[str], output: Path | None, kind: str, draw: Callable[[list[Preset], Report], Figure]) -> None:
    from training.figures.style import check_format, figure_bytes

    path = output or Path(f"{kind}.png")
    try:
        check_format(path)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--output") from error
    loaded = [open_preset(name) for name in names]
    with whole_file(path) as file, progress(f"figure {kind}") as report:
        file.write(figure_bytes(draw(loaded, report), path.suffix))
    print(path)
