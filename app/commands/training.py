"""dataset, train, evaluate: data sets, presets and their errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from app.commands.arguments import Cache, Json, PresetName, open_preset
from app.commands.console import Failure, duration, number, print_json, print_table, progress, say

if TYPE_CHECKING:
    from collections.abc import Callable

    from app.commands.console import Report
    from engine.preset import Preset
    from training.configuration import DatasetConfiguration
    from training.dataset import Dataset
    from training.fit import Progress

Configuration = Annotated[
    str, typer.Argument(metavar="CONFIG", help="A configuration's name, or the path of its .toml file.")
]
Device = Literal["cpu", "cuda", "auto"]
Split = Literal["validation", "test", "both"]
LARGEST_DATASET_BYTES = 16 * 2**30
WINDOWS = 4  # of the horizon, in evaluate


def dataset(config: Configuration, cache: Cache = None, json: Json = False) -> None:
    """Make the data set of a training configuration, or find it in the cache, and describe it."""
    from training.configuration import load
    from training.dataset import dataset_folder, dataset_key, draw_initial

    configuration = load(config).data
    made = _load_dataset(configuration, cache)
    rise = configuration.string.relative_tension_rise(draw_initial(configuration)).sort().values
    facts: dict[str, Any] = {
        "folder": str(dataset_folder(configuration, cache)),
        "key": dataset_key(configuration),
        "shape": list(made.amplitudes.shape),
        "scale_m": made.scale_m,
        "tension_rise": {
            "median": float(rise.quantile(0.5)),
            "percentile_95": float(rise.quantile(0.95)),
            "max": float(rise[-1]),
        },
    }
    if json:
        print_json(facts)
        return
    print(f"folder        {facts['folder']}")
    print(f"key           {facts['key']}")
    print(f"shape         {tuple(made.amplitudes.shape)} (trajectories, frames, modes), float32 in m")
    print(f"scale         {1000 * made.scale_m:.4g} mm")
    rise_percent = [f"{100 * value:.2g} %" for value in facts["tension_rise"].values()]
    print("tension rise  median {}, 95th percentile {}, largest {}".format(*rise_percent))


def train(
    config: Configuration,
    output: Annotated[
        Path | None, typer.Option(help="The preset to write; default presets/CONFIG.safetensors.")
    ] = None,
    runs: Annotated[Path | None, typer.Option(help="Folder of runs, each with its checkpoint and log.csv.")] = None,
    device: Annotated[Device, typer.Option(help="auto takes a CUDA device where there is one.")] = "cpu",
    threads: Annotated[int | None, typer.Option(min=1, help="Threads of the CPU; default all cores.")] = None,
    cache: Cache = None,
) -> None:
    """Train a preset: data set, fit, and the errors of the preset that was written.

    An interrupted run goes on where it was; the same command continues it.
    """
    import torch

    from engine.preset import SHIPPED
    from training.configuration import load
    from training.run import default_runs
    from training.run import train as run  # this command has the name

    configuration = load(config)
    name = Path(config).stem
    file = output or SHIPPED / f"{name}.safetensors"
    run_folder = (runs or default_runs()) / name
    if threads is not None:
        torch.set_num_threads(threads)
    try:
        data = _load_dataset(configuration.data, cache)
        with progress("train") as report:
            trained = run(
                configuration, data, file, run_folder, device=_device(device), report=_training_report(report)
            )
    except KeyboardInterrupt:
        say(f"stopped; the same command goes on with {run_folder}")
        raise
    print(trained.preset.path)
    for split, sums in (("validation", trained.validation), ("test", trained.test)):
        error = sums.total()
        print(f"{split:<11} rel. MSE {number(error.rel_mse)}, rel. MAE {number(error.rel_mae)}")
    print(f"trained in  {duration(trained.result.seconds)}, best epoch {trained.result.best_epoch}")


def evaluate(
    preset: PresetName,
    split: Annotated[Split, typer.Option(help="The tables of the paper are of validation.")] = "validation",
    cache: Cache = None,
    json: Json = False,
) -> None:
    """Measure a preset's errors on the data set that it was trained with, beside those stored in it."""
    loaded = open_preset(preset)
    splits = ("validation", "test") if split == "both" else (split,)
    data = _dataset_of(loaded, cache)
    measured = {name: _measured(loaded, data, name) for name in splits}
    first = measured[splits[0]]
    if json:
        facts = {"preset": loaded.name, "file": str(loaded.path), "split": split}
        print_json({**facts, "rel_mse": first["rel_mse"], "rel_mae": first["rel_mae"], **measured})
        return
    for name, errors in measured.items():
        print(f"{name}: rel. MSE {number(errors['rel_mse'])}, rel. MAE {number(errors['rel_mae'])}")
        print(f"stored in the preset: {number(errors['stored_rel_mse'])}, {number(errors['stored_rel_mae'])}")
        print_table(("from s", "to s", "rel. MSE", "rel. MAE"), [list(w.values()) for w in errors["windows"]])


def _load_dataset(configuration: DatasetConfiguration, cache: Path | None) -> Dataset:
    from training.dataset import load_dataset

    with progress("data set") as report:
        return load_dataset(configuration, cache, lambda done, total: report(done / total))


def _device(wanted: Device) -> str:
    import torch

    if wanted == "cpu":
        return "cpu"
    if torch.cuda.is_available():
        return "cuda"
    if wanted == "cuda":
        raise Failure("no CUDA device can be used here; choose --device cpu")
    return "cpu"


def _training_report(report: Report) -> Callable[[Progress], None]:
    """Epoch, horizon, loss and the last validation as progress."""
    last = ""

    def told(p: Progress) -> None:
        nonlocal last
        if p.validation:
            last = f", val. MAE {number(p.validation.rel_mae)}"
        text = f"epoch {p.epoch}/{p.epochs}, horizon {p.horizon}, loss {number(p.loss)}{last}"
        report(p.epoch / p.epochs, text, p.seconds_left)

    return told


def _dataset_of(preset: Preset, cache: Path | None) -> Dataset:
    """The data set that a preset names, in the preset's own unit."""
    from engine.schema import SchemaError, read
    from training.configuration import TrainingConfiguration

    info = preset.info
    try:
        data = read(TrainingConfiguration, info.training, f"{preset.path}: metadata.training").data
    except SchemaError as error:
        raise Failure(f"{error}; without it the preset's data set cannot be made") from error
    size = 4 * data.count * (data.steps + 1) * data.modes
    if size > LARGEST_DATASET_BYTES:
        raise Failure(f"{preset.path}: its data set would take {size / 2**30:.0f} GiB; get the preset again")
    if data.grid_points != info.grid_points:
        raise Failure(f"{preset.path}: metadata.training is of another grid than the model; get the preset again")
    return replace(_load_dataset(data, cache), scale_m=info.scale_m)


def _measured(preset: Preset, data: Dataset, split: str) -> dict[str, Any]:
    from training.evaluate import evaluate_model

    info, steps = preset.info, data.configuration.steps
    sums = evaluate_model(preset.model, data, split)
    total = sums.total()
    edges = [steps / info.rate_hz * part / WINDOWS for part in range(WINDOWS + 1)]
    windows = sums.windows(info.rate_hz, edges)
    validation = split == "validation"
    return {
        "rel_mse": total.rel_mse,
        "rel_mae": total.rel_mae,
        "stored_rel_mse": info.rel_mse if validation else info.test_rel_mse,
        "stored_rel_mae": info.rel_mae if validation else info.test_rel_mae,
        "windows": [
            {"start_s": w.start_s, "stop_s": w.stop_s, "rel_mse": w.rel_mse, "rel_mae": w.rel_mae} for w in windows
        ],
    }
