"""train: a run's training."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from statistics import mean, stdev
from typing import TYPE_CHECKING, Annotated

import typer

from engine.bounds import LARGEST_SEED, MOST_EPOCHS, MOST_SEEDS, MOST_WORKERS
from engine.plain_text import duration, name_text
from training.cli.arguments import Cache, Device, Runs
from training.cli.console import Failure, number, progress, say

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from training.cli.console import ProgressReport
    from training.configuration import DatasetConfiguration, TrainingConfiguration
    from training.data.dataset import Dataset
    from training.fitting.fit import FitProgress
    from training.results import Row

Configuration = Annotated[
    str,
    typer.Argument(
        metavar="CONFIG",
        help="The name of a run (a cell of the tables, or a file of training/configurations), or a .toml file.",
    ),
]


def train(
    config: Configuration,
    output: Annotated[
        Path | None, typer.Option(help="The preset to write; default CONFIG.safetensors in the run's folder.")
    ] = None,
    runs: Runs = None,
    seed: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=LARGEST_SEED,
            metavar="N",
            help="Of weights and batches, in place of the run's own; it is named CONFIG_seedN then.",
        ),
    ] = None,
    seeds: Annotated[
        int,
        typer.Option(
            min=1, max=MOST_SEEDS, metavar="N", help="Train N seeds together, the run's own or --seed first."
        ),
    ] = 1,
    epochs: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=MOST_EPOCHS,
            metavar="N",
            help="In place of the recipe's, its schedule with them; the run is named CONFIG_epochsN then.",
        ),
    ] = None,
    device: Annotated[Device, typer.Option(help="auto: CUDA if it can be used.")] = "cpu",
    threads: Annotated[
        int | None, typer.Option(min=1, max=MOST_WORKERS, help="Threads of the CPU; default all cores.")
    ] = None,
    cache: Cache = None,
) -> None:
    """Train a preset and measure its errors.

    Its data set is made if needed. The same command continues a run that was interrupted.
    """
    import torch

    from training.run import NamedRun, default_runs, device_of, run_rows

    if seeds > 1 and output is not None:
        raise typer.BadParameter(
            "is of one preset; several --seeds write into their runs' folders", param_hint="--output"
        )
    folder = runs or default_runs()
    begun: list[FitProgress] = []  # empty where all was finished already
    chosen = [_chosen(config, seed, number, epochs) for number in range(seeds)]
    if threads is not None:
        torch.set_num_threads(threads)
    try:
        load_data(chosen[0][2].data, cache)
        with progress("train") as report:
            shown = training_report(report)

            def follow(latest: FitProgress) -> None:
                begun.append(latest)
                shown(latest)

            named = [NamedRun(*run, output, follow) for run in chosen]
            rows = run_rows(
                named,
                folder,
                cache=cache,
                device=device_of(device),
                waits=lambda: say(f"{folder / named[0].name}: another process trains there; waiting for its end"),
            )
    except KeyboardInterrupt:
        say(f"stopped; the same command continues with {folder / chosen[0][0]}")
        raise
    for run, row in zip(named, rows, strict=True):
        if row.status != "done":
            raise Failure(f"{run.name}: {row.message}")
        _tell_row(run.output(folder), row)
    if seeds > 1:
        _tell_mean(rows)
    print_known(known_errors(chosen[0][2]))
    if not begun:
        print("finished earlier, nothing was trained now")
    for run in named:
        _tell_heard(run.output(folder))


def _with_seed(config: str, seed: int | None, number: int) -> tuple[str, TrainingConfiguration]:
    """Name and configuration of a run with its own seed or `seed`, plus `number`."""
    from training.cell import Cell, load

    configuration, name = load(config), name_text(Path(config).stem)
    wanted = (configuration.recipe.seed if seed is None else seed) + number
    if wanted == configuration.recipe.seed:
        return name, configuration
    cell = Cell.parse(config)
    if cell is not None and cell.seed:
        raise typer.BadParameter(f"{config} has a seed already; leave one out", param_hint="--seed")
    name += f"_seed{wanted}"
    if cell is not None:
        return name, load(name)
    title, recipe = f"{configuration.title}, seed {wanted}", replace(configuration.recipe, seed=wanted)
    return name, replace(configuration, title=title, recipe=recipe)


def _chosen(config: str, seed: int | None, number: int, epochs: int | None) -> tuple[str, str, TrainingConfiguration]:
    """Name, recipe ("": it fills no cell) and configuration of a run; `epochs` in place of its recipe's own."""
    from training.cell import Cell

    name, configuration = _with_seed(config, seed, number)
    if epochs is None or epochs == configuration.recipe.epochs:
        cell = Cell.parse(name)
        return name, cell.recipe if cell else "", configuration
    title, recipe = f"{configuration.title}, {epochs} epochs", replace(configuration.recipe, epochs=epochs)
    return f"{name}_epochs{epochs}", "", replace(configuration, title=title, recipe=recipe)


def _tell_row(file: Path, row: Row) -> None:
    print(file)
    _print_errors("validation", row.rel_mse, row.rel_mae)
    _print_errors("test", row.test_rel_mse, row.test_rel_mae)
    if row.start_rel_mse is not None and row.start_rel_mae is not None:
        _print_errors("untrained", row.start_rel_mse, row.start_rel_mae, " (validation)")
    epoch = "" if row.epochs == 1 else f", best epoch {row.best_epoch}"  # a closed form has one
    print(f"trained in  {duration(row.seconds or 0.0)}{epoch}")


def _tell_mean(rows: Sequence[Row]) -> None:
    """Print mean and standard deviation of the validation errors, as the paper's tables state them."""
    errors = {"MSE": [row.rel_mse or 0.0 for row in rows], "MAE": [row.rel_mae or 0.0 for row in rows]}
    words = ", ".join(f"rel. {name} {number(mean(of))} ± {number(stdev(of))}" for name, of in errors.items())
    print(f"{len(rows)} seeds{'':<4} {words} (validation)")


Known = dict[str, tuple[float | None, float | None]]


def known_errors(run: TrainingConfiguration) -> Known:
    """Relative MSE and MAE on validation: the "paper"'s of the same cell, the "project"'s results of the same run."""
    from training.cell import follows_protocol
    from training.results import RESULTS, read_results
    from training.tables.paper import DatasetColumn, paper_errors

    known_by_source: Known = {}
    place = (run.data.string_kind, run.steps, run.model, DatasetColumn(run.data.initial, run.data.rate_hz))
    paper = paper_errors().get(place) if follows_protocol(run.data) else None
    if paper is not None and paper.rel_mse and paper.rel_mae:
        known_by_source["paper"] = paper.rel_mse.mean, paper.rel_mae.mean
    for known in read_results(RESULTS):
        if known.digest == run.digest and known.status == "done":
            known_by_source["project"] = known.rel_mse, known.rel_mae
    return known_by_source


def print_known(known: Known) -> None:
    for whose, (mse, mae) in known.items():
        _print_errors(whose, mse, mae, " (validation)")


def _print_errors(what: str, mse: float | None, mae: float | None, note: str = "") -> None:
    print(f"{what:<11} rel. MSE {number(mse)}, rel. MAE {number(mae)}{note}")


def _tell_heard(file: Path) -> None:
    """Compare the sound of the preset with the truth, and add the result to the table beside it."""
    from training.heard import measure
    from training.heard_words import heard_sentence

    try:
        with progress("listen") as report:
            print(f"heard       {heard_sentence(measure(file, True, report), file.stem)}")
    except ValueError as error:  # the model cannot start from a displaced string at rest alone
        say(f"not listened to: {error}")


def load_data(configuration: DatasetConfiguration, cache: Path | None) -> Dataset:
    """The data set of a configuration, from the cache or made, with its progress shown."""
    from training.data.dataset import load_dataset

    with progress("data set") as report:
        return load_dataset(configuration, cache, report)


def training_report(report: ProgressReport) -> Callable[[FitProgress], None]:
    """Step, epoch, horizon, loss and the last validation as progress."""
    last = ""

    def reported(p: FitProgress) -> None:
        nonlocal last
        if p.validation:
            last = f", val. MAE {number(p.validation.rel_mae)}"
        text = f"step {p.step}, epoch {p.epoch}/{p.epochs}, horizon {p.horizon}, loss {number(p.loss)}{last}"
        report(p.step / p.steps, text, p.seconds_left)

    return reported
