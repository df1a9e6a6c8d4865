"""A whole run: fit, errors, preset, and the preset read back."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Any

import torch
from filelock import FileLock, Timeout

from engine.compare.relative import ErrorSums
from engine.folders import working_folder
from engine.models.base import StringModel, count_parameters
from engine.presets import Preset, PresetError, PresetInfo, TrainedRange, load_preset, read_info, save_preset
from engine.schema import SchemaError, read, write
from engine.whole_file import whole_file
from training import provenance
from training.configuration import DatasetConfiguration, Run, TrainingConfiguration, read_configuration
from training.data.dataset import Dataset, load_dataset
from training.data.draws import (
    CENTRE_RANGE,
    PEAK_RANGE_M,
    PLUCK_PEAK_RANGE_M,
    PLUCK_POSITION_RANGE,
    PLUCK_WIDTH_RANGE,
    WIDTH_RANGE,
)
from training.evaluate import evaluate_model, figures
from training.fitting.fit import Diverged, FitProgress, FitResult, Report, fit_seeds
from training.fitting.log import TrainingLog
from training.results import QUARTERS, SHORT_HORIZON, Row

PREFIXES = {"validation": "", "test": "test_"}  # of a row's columns, by split
# columns of a row that a preset repeats
REPEATED = ("rel_mse", "rel_mae", "test_rel_mse", "test_rel_mae")


def preset_file(folder: Path, name: str) -> Path:
    """The place of a run's preset in the folder of runs."""
    return folder / name / f"{name}.safetensors"


def _saved(configuration: TrainingConfiguration, dataset: Dataset, result: FitResult, output: Path) -> dict[str, Any]:
    """Write the preset `output` of a finished fit; its errors and what it took, as in a row."""
    model = result.model.cpu()
    sums = {"validation": result.validation, "test": evaluate_model(model, dataset, "test", configuration.steps)}
    errors = row_errors(model, dataset, sums, configuration.steps)
    save_preset(output, preset_info(configuration, dataset, result, errors), model)
    weights = load_preset(output).model.state_dict()
    if not all(torch.equal(weights[name], weight) for name, weight in model.state_dict().items()):
        raise RuntimeError(f"{output}: holds other weights than the trained model; train it again")
    return errors | _cost_and_spread(configuration, result, sums["validation"])


def run_rows(
    runs: Sequence[Run],
    folder: Path,
    *,
    output: Path | None = None,
    cache: Path | None = None,
    device: torch.device | str = "cpu",
    report: Report = lambda run, progress: None,
    waits: Callable[[], None] = lambda: None,
    checkpoint_every_s: float | None = None,
) -> list[Row]:
    """Runs that differ in their seeds alone, trained together, as rows of the results file.

    Where a run was done before, its row is read and it is not trained. Where its preset is elsewhere, it is written
    again from the run's checkpoint. A run that diverges is a result too: a row that says so.

    Args:
        folder: a run's own is folder/NAME: checkpoint, log.csv, row, and the preset if it has no other place.
        output: the preset of a single run; None: see `preset_file`.
        report: receives the progress of each run, when an epoch is in its log.
        waits: is called where another process trains in such a folder, whose end is awaited.

    Raises:
        ValueError: see `fit_seeds`.
        RuntimeError: a preset that was written is not the model that was trained.
        OSError: a folder cannot be written.
    """
    presets = {run.name: output or preset_file(folder, run.name) for run in runs}
    logs = {run.name: TrainingLog(folder / run.name / "log.csv") for run in runs}

    def log_and_report(run: Run, progress: FitProgress) -> None:
        if progress.ends_epoch:
            logs[run.name].add(progress)
        report(run, progress)

    with ExitStack() as locks:
        # never two in one folder, even where a worker that was taken for dead still trains
        for name in sorted(presets):  # in one order, or two processes could await each other
            (folder / name).mkdir(parents=True, exist_ok=True)
            locks.enter_context(_held(folder / name / "run.lock", waits))
        rows = {run.name: row for run in runs if (row := _known_row(run, folder)) is not None}
        left = [run for run in runs if run.name not in rows or not _made_by(run, presets[run.name])]
        if left:
            dataset = load_dataset(left[0].configuration.data, cache)
            for run in left:
                _check_writable(presets[run.name].parent)
            every_s = checkpoint_every_s
            outcomes = fit_seeds(
                left, dataset, folder, report=log_and_report, device=device, checkpoint_every_s=every_s
            )
            for run, outcome in zip(left, outcomes, strict=True):
                facts = row_facts(run) | _circumstances(run, device)
                if isinstance(outcome, Diverged):
                    row = Row(**facts, status="diverged", message=str(outcome), finished=provenance.now())
                else:
                    columns = _saved(run.configuration, dataset, outcome, presets[run.name])
                    row = Row(**facts, status="done", finished=provenance.now(), **columns)
                    row = _kept(row, rows.get(run.name), folder / run.name / "row.json")
                rows[run.name] = row
        return [rows[run.name] for run in runs]


def _check_writable(folder: Path) -> None:
    """Raise OSError before the work: nothing can be written there."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder):
        pass


def _known_row(run: Run, folder: Path) -> Row | None:
    """The row that the run left in its folder; None where there is none, or one of another configuration."""
    file = folder / run.name / "row.json"
    if not file.exists():
        return None
    try:
        row = read(Row, json.loads(file.read_text(encoding="utf-8")), str(file))
    except ValueError as error:
        raise ValueError(f"{file}: not a row ({error}); delete it to measure the run again") from error
    return row if row.digest == run.digest else None


def _kept(row: Row, known: Row | None, file: Path) -> Row:
    """The row that stays of a run that is done, and is in its file."""
    if known is not None and (known.rel_mse, known.seconds) == (row.rel_mse, row.seconds):
        return known  # the preset alone was missing: where and when it was trained stays
    with whole_file(file) as unfinished:
        unfinished.write_text(json.dumps(write(row), indent=2), encoding="utf-8")
    return row


def row_facts(run: Run) -> dict[str, Any]:
    """The columns of a row that say which run it is."""
    configuration = run.configuration
    return {
        "digest": run.digest,
        "name": run.name,
        "model": configuration.model,
        "string": configuration.data.string_kind,
        "initial": configuration.data.initial,
        "rate_hz": configuration.data.rate_hz,
        "horizon": configuration.steps,
        "recipe": run.recipe,
        "seed": configuration.recipe.seed,
    }


def _circumstances(run: Run, device: torch.device | str) -> dict[str, Any]:
    """The columns that say how it started, and where it was trained."""
    return {
        "initialisation": run.configuration.start,
        "device": torch.device(device).type,
        "threads": torch.get_num_threads(),
        "hardware": provenance.hardware(device),
        "torch": torch.__version__,
        "commit": provenance.commit(),
    }


def _made_by(run: Run, preset: Path) -> bool:
    """Return True if a file is the preset of this run."""
    try:
        return configuration_of(read_info(preset), str(preset)).digest == run.digest
    except (PresetError, SchemaError):
        return False


def _held(path: Path, waits: Callable[[], None]) -> AbstractContextManager[object]:
    """The lock of a file, held; `waits` is called once where another process has it, whose end is awaited."""
    lock = FileLock(path)
    try:
        return lock.acquire(timeout=0)
    except Timeout:
        waits()
        return lock.acquire()


def row_errors(
    model: StringModel[Any], dataset: Dataset, whole: Mapping[str, ErrorSums], steps: int
) -> dict[str, float | None]:
    """The columns of a row by name.

    None for an error that is infinite, and none over 400 frames of a shorter run.

    Args:
        whole: of "validation" and "test", over `steps` frames.
    """
    columns: dict[str, float | None] = {}
    for split, prefix in PREFIXES.items():
        columns |= _columns(f"{prefix}{{}}", whole[split])
        if steps >= SHORT_HORIZON and dataset.configuration.stride == 1:
            same = steps == SHORT_HORIZON
            short = whole[split] if same else evaluate_model(model, dataset, split, SHORT_HORIZON)
            columns |= _columns(f"{prefix}{{}}_{SHORT_HORIZON}", short)
    return columns


def _columns(form: str, sums: ErrorSums) -> dict[str, float | None]:
    """The total errors and their standard errors by column; None where one is not finite.

    `form`: a column's name, in which {} stands for rel_mse and rel_mae, as in `figures`.
    """
    values = figures(sums.total(), form) | figures(sums.standard_error(), f"{form}_se")
    return {name: value if math.isfinite(value) else None for name, value in values.items()}


def configuration_of(info: PresetInfo, where: str) -> TrainingConfiguration:
    """The run that made a preset.

    Raises:
        SchemaError: the preset does not tell it.
    """
    return read_configuration(info.training, f"{where}: metadata.training")


def data_of(preset: Preset) -> DatasetConfiguration:
    """The data set on which a preset of one string was trained.

    Raises:
        PresetError: the preset does not name it, or names that of another model.
    """
    try:
        data = configuration_of(preset.info, str(preset.path)).data
    except SchemaError as error:
        raise PresetError(f"{error}; without it the preset's data set is not known") from error
    for name in ("rate_hz", "modes", "grid_points"):
        mine, its = getattr(data, name), getattr(preset.info, name)
        if mine != its:
            raise PresetError(
                f"{preset.path}: metadata.training.data.{name} is {mine}, the model's is {its}; get the preset again"
            )
    return data


def _cost_and_spread(configuration: TrainingConfiguration, result: FitResult, sums: ErrorSums) -> dict[str, Any]:
    """The figures of a run: its cost, and how validation errors spread over trajectories and time, as in a row."""
    data = configuration.data
    columns: dict[str, Any] = {
        **figures(sums.spread(), "{}_spread"),
        **(figures(result.start, "start_{}") if result.start else {}),
        "parameters": count_parameters(result.model),
        "epochs": result.epochs,
        "best_epoch": result.best_epoch,
        "seconds": result.seconds,
    }
    horizon_s = configuration.steps / data.rate_hz
    edges_s = [horizon_s * quarter / QUARTERS for quarter in range(QUARTERS + 1)]
    for number, window in enumerate(sums.windows(data.rate_hz / data.stride, edges_s), 1):
        columns |= figures(window, f"{{}}_q{number}")
    return columns


def device_of(wanted: str) -> str:
    """The device, cpu or cuda; "auto" takes CUDA where it can be used. Raises ValueError: CUDA cannot be used."""
    if wanted != "cpu" and torch.cuda.is_available():
        return "cuda"
    if wanted == "cuda":
        raise ValueError("no CUDA device can be used here; choose --device cpu")
    return "cpu"


def default_runs() -> Path:
    """LEARNED_STRINGS_RUNS, else the working folder `runs`: a folder per run, with its checkpoint and log."""
    return working_folder("LEARNED_STRINGS_RUNS", "runs")


def preset_info(
    configuration: TrainingConfiguration, dataset: Dataset, result: FitResult, errors: Mapping[str, Any]
) -> PresetInfo:
    """The description of a finished fit's preset; `errors` as in a row."""
    data, recipe = configuration.data, configuration.recipe
    return PresetInfo(
        title=configuration.title,
        description=configuration.description,
        model=configuration.model,
        model_configuration=write(result.model.configuration),
        string=data.string,
        tension_modulated=data.tension_modulated,
        initial=data.initial,
        rate_hz=data.rate_hz,
        modes=data.modes,
        grid_points=data.grid_points,
        horizon_steps=configuration.steps,
        scale_m=dataset.scale_m,
        trained_range=trained_range(data),
        initialisation=configuration.start,
        knows=configuration.knowledge,
        seed=recipe.seed,
        **{name: errors[name] for name in REPEATED},
        training_seconds=result.seconds,
        training=write(configuration),
    )


def trained_range(data: DatasetConfiguration) -> TrainedRange:
    """The ranges of a data set's random draws; noise has neither a place nor a width."""
    rise = data.largest_tension_rise
    if data.initial == "pluck":
        widths = {"gaussian": PLUCK_WIDTH_RANGE, "raised_cosine": PLUCK_WIDTH_RANGE}
        return TrainedRange(PLUCK_POSITION_RANGE, widths, PLUCK_PEAK_RANGE_M, rise)
    if data.initial == "noise":
        return TrainedRange(None, None, PEAK_RANGE_M, rise)
    return TrainedRange(CENTRE_RANGE, {"gaussian": WIDTH_RANGE}, PEAK_RANGE_M, rise)
