"""train: a run's training."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from statistics import mean, stdev
from typing import TYPE_CHECKING, Annotated, Any

import typer

from engine.bounds import LARGEST_SEED, MOST_EPOCHS, MOST_SEEDS, MOST_WORKERS
from engine.plain_text import duration, name_text
from training.cli.arguments import Cache, Device, Runs, check_range, check_suffix
from training.cli.console import Failure, number, progress, say

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from training.cli.console import ProgressReport
    from training.configuration import DatasetConfiguration, Run, TrainingConfiguration
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

    from training.run import default_runs, device_of, preset_file, run_rows

    if seeds > 1 and output is not None:
        raise typer.BadParameter(
            "is of one preset; several --seeds write into their runs' folders", param_hint="--output"
        )
    if output is not None:
        check_suffix("--output", output, ".safetensors")
    folder = runs or default_runs()
    begun: list[FitProgress] = []  # empty where all was finished already
    chosen = [_run_of(config, seed, number, epochs) for number in range(seeds)]
    files = [output or preset_file(folder, run.name) for run in chosen]
    if threads is not None:
        torch.set_num_threads(threads)
    try:
        load_data(chosen[0].configuration.data, cache)
        with progress("train") as report:
            shown = training_report(report)

            def follow(run: Run, latest: FitProgress) -> None:
                begun.append(latest)
                shown(latest)

            rows = run_rows(
                chosen,
                folder,
                output=output,
                cache=cache,
                device=device_of(device),
                report=follow,
                waits=lambda: say(f"{folder / chosen[0].name}: another process trains there; waiting for its end"),
            )
    except KeyboardInterrupt:
        say(f"stopped; the same command continues with {folder / chosen[0].name}")
        raise
    for file, row in zip(files, rows, strict=True):
        if row.status != "done":
            raise Failure(f"{row.name}: {row.message}")
        _tell_row(file, row)
    if seeds > 1:
        _tell_mean(rows)
    print_known(known_errors(chosen[0].configuration))
    if not begun:
        print("finished earlier, nothing was trained now")
    for file in files:
        _tell_heard(file)


def _run_of(config: str, seed: int | None, number: int, epochs: int | None) -> Run:
    """The run of a configuration with its own seed or `seed`, plus `number`, and `epochs` if they are given."""
    from training.cell import Cell, load
    from training.configuration import Run

    if (shortened := re.fullmatch(r"(.+)_epochs([1-9]\d{0,8})", config)) is not None:
        if epochs is not None:
            raise typer.BadParameter(f"{config} has epochs already; leave one out", param_hint="--epochs")
        config, epochs = shortened[1], int(shortened[2])
        check_range("CONFIG's epochs", epochs, 1, MOST_EPOCHS)
    configuration, name, cell = load(config), name_text(Path(config).stem), Cell.parse(config)
    wanted = (configuration.recipe.seed if seed is None else seed) + number
    if wanted != configuration.recipe.seed:
        if cell is not None and cell.seed:
            raise typer.BadParameter(f"{config} has a seed already; leave one out", param_hint="--seed")
        name += f"_seed{wanted}"
        configuration = load(name) if cell else _changed(configuration, f"seed {wanted}", seed=wanted)
    if epochs is None or epochs == configuration.recipe.epochs:
        return Run(name, cell.recipe if cell else "", configuration)
    changed = _changed(configuration, f"{epochs} epochs", epochs=epochs)
    return Run(f"{name}_epochs{epochs}", "", changed)  # no row of its recipe


def _changed(configuration: TrainingConfiguration, words: str, **recipe: Any) -> TrainingConfiguration:
    """A configuration with other fields of its recipe, of which its title says `words`."""
    title = f"{configuration.title}, {words}"
    return replace(configuration, title=title, recipe=replace(configuration.recipe, **recipe))


def _tell_row(file: Path, row: Row) -> None:
    """Print a preset's file, the errors of its run, and how long it was trained."""
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
    """Print a line of relative errors; `what`: the split, or whose they are; None: "-"."""
    print(f"{what:<11} rel. MSE {number(mse)}, rel. MAE {number(mae)}{note}")


def _tell_heard(file: Path) -> None:
    """Tell the audible errors of a preset, from the table beside it, or measured and added to it."""
    from engine.presets import preset_digest
    from training.heard import measure
    from training.heard_file import read_heard
    from training.heard_words import heard_sentence

    try:
        heard = read_heard(file.parent)[0].get(preset_digest(file))
        if heard is None:
            with progress("listen") as report:
                heard = measure(file, True, report)
        print(f"heard       {heard_sentence(heard, file.stem)}")
    except ValueError as error:  # the model cannot start from a displaced string at rest alone
        say(f"not listened to: {error}")


def load_data(configuration: DatasetConfiguration, cache: Path | None) -> Dataset:
    """The data set of a configuration, from the cache or made, with its progress shown."""
    from training.data.dataset import load_dataset

    with progress("data set") as report:
        return load_dataset(configuration, cache, report)


def training_report(report: ProgressReport) -> Callable[[FitProgress], None]:
    """A function that reports a training's progress: step, epoch, horizon, loss and the last validation error."""
    last = ""  # validation error, in words

    def reported(p: FitProgress) -> None:
        nonlocal last
        if p.validation:
            last = f", val. MAE {number(p.validation.rel_mae)}"
        text = f"step {p.step}, epoch {p.epoch}/{p.epochs}, horizon {p.horizon}, loss {number(p.loss)}{last}"
        report(p.step / p.steps, text, p.seconds_left)

    return reported
