"""A whole run: fit, errors, preset, and the preset read back."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from filelock import FileLock, Timeout

from engine.metrics import ErrorSums
from engine.models.base import count_parameters
from engine.presets import PresetError, PresetInfo, TrainedRange, load_preset, read_info, save_preset
from engine.schema import SchemaError, read, write
from engine.whole_file import whole_file
from training import provenance
from training.configuration import DatasetConfiguration, TrainingConfiguration
from training.data.dataset import Dataset, load_dataset
from training.data.draws import (
    CENTRE_RANGE,
    PEAK_RANGE_M,
    PLUCK_PEAK_RANGE_M,
    PLUCK_POSITION_RANGE,
    PLUCK_WIDTH_RANGE,
    WIDTH_RANGE,
)
from training.evaluate import evaluate_model
from training.fitting.fit import Diverged, FitResult, Progress, fit
from training.fitting.log import TrainingLog
from training.results import QUARTERS, Row
from training.row_errors import REPEATED, configuration_of, row_errors
from training.start import knowledge_of


def _trained(
    configuration: TrainingConfiguration,
    dataset: Dataset,
    output: Path,
    run_folder: Path,
    *,
    device: torch.device | str,
    report: Callable[[Progress], None],
    checkpoint_every_s: float | None,
) -> dict[str, Any]:
    """Makes the preset `output`, or continues with the run in `run_folder`; its errors and what it took, as in a row.

    An epoch is in `run_folder`/log.csv when it is reported; the run ends with a plot, log.png.

    Raises:
        Diverged, ValueError: see `fit`.
        RuntimeError: the preset that was written is not the model that was trained.
        OSError: a folder cannot be written.
    """
    output.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=output.parent):
        pass  # a folder that cannot be written is reported before the work
    log = TrainingLog(run_folder / "log.csv")

    def log_and_report(progress: Progress) -> None:
        if progress.ends_epoch:
            log.add(progress)
        report(progress)

    result = fit(
        configuration,
        dataset,
        run_folder,
        device=device,
        report=log_and_report,
        checkpoint_every_s=checkpoint_every_s,
    )
    model = result.model.cpu()
    sums = {"validation": result.validation, "test": evaluate_model(model, dataset, "test", configuration.steps)}
    figures = row_errors(model, dataset, sums, configuration.steps)
    save_preset(output, preset_info(configuration, dataset, result, figures), model)
    weights = load_preset(output).model.state_dict()
    if not all(torch.equal(weights[name], weight) for name, weight in model.state_dict().items()):
        raise RuntimeError(f"{output}: holds other weights than the trained model; train it again")
    return figures | _figures(configuration, result, sums["validation"])


def run_row(
    name: str,
    recipe: str,
    configuration: TrainingConfiguration,
    runs: Path,
    *,
    cache: Path | None = None,
    device: torch.device | str = "cpu",
    report: Callable[[Progress], None] = lambda progress: None,
    waits: Callable[[], None] = lambda: None,
    preset: Path | None = None,
    checkpoint_every_s: float | None = None,
) -> Row:
    """A run as a row of the results file. Where it was done before, its row is read and nothing is trained.

    Where the preset of a run that was done is elsewhere, it is written again from the run's checkpoint.

    A run that diverges is a result too: a row that says so.

    Args:
        name, recipe: as the row shall carry them.
        runs: the run's folder is runs/name: checkpoint, log and its plot, row, and the preset where `preset` is None.
        waits: is called where another process trains in that folder, whose end is awaited.

    Raises:
        ValueError, RuntimeError, OSError: see `_trained`.
    """
    folder = runs / name
    folder.mkdir(parents=True, exist_ok=True)
    # never two in one folder, even where a worker that was taken for dead still trains
    with _held(folder / "run.lock", waits):
        file = folder / "row.json"
        output = preset or folder / f"{name}.safetensors"
        known = _read_row(file) if file.exists() else None
        if known is not None and known.digest != configuration.digest:
            known = None
        if known is not None and _made_by(configuration, output):
            return known
        dataset = load_dataset(configuration.data, cache)
        facts: dict[str, Any] = {
            "digest": configuration.digest,
            "name": name,
            "model": configuration.model,
            "string": "nonlinear" if configuration.data.tension_modulated else "linear",
            "initial": configuration.data.initial,
            "rate_hz": configuration.data.rate_hz,
            "horizon": configuration.steps,
            "recipe": recipe,
            "seed": configuration.recipe.seed,
            "initialisation": configuration.start,
            "device": torch.device(device).type,
            "threads": torch.get_num_threads(),
            "hardware": provenance.hardware(device),
            "torch": torch.__version__,
            "commit": provenance.commit(),
        }
        try:
            figures = _trained(
                configuration,
                dataset,
                output,
                folder,
                device=device,
                report=report,
                checkpoint_every_s=checkpoint_every_s,
            )
        except Diverged as error:
            return Row(**facts, status="diverged", message=str(error), finished=provenance.now())
        row = Row(**facts, status="done", finished=provenance.now(), **figures)
        if known is not None and (known.rel_mse, known.seconds) == (row.rel_mse, row.seconds):
            return known  # the preset alone was missing: where and when it was trained stays
        with whole_file(file) as unfinished:
            unfinished.write_text(json.dumps(write(row), indent=2), encoding="utf-8")
        return row


def _made_by(configuration: TrainingConfiguration, preset: Path) -> bool:
    """Whether a file is the preset of this run."""
    try:
        return configuration_of(read_info(preset), str(preset)).digest == configuration.digest
    except (PresetError, SchemaError):
        return False


@contextmanager
def _held(path: Path, waits: Callable[[], None]) -> Iterator[None]:
    lock = FileLock(path)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        waits()
        lock.acquire()
    try:
        yield
    finally:
        lock.release()


def _figures(configuration: TrainingConfiguration, result: FitResult, sums: ErrorSums) -> dict[str, Any]:
    """What a run took, and how its errors on validation are spread over trajectories and time, as in a row."""
    spread, data = sums.spread(), configuration.data
    figures: dict[str, Any] = {
        "rel_mse_spread": spread.rel_mse,
        "rel_mae_spread": spread.rel_mae,
        "parameters": count_parameters(result.model),
        "epochs": result.epochs,
        "start_rel_mse": result.start.rel_mse if result.start else None,
        "start_rel_mae": result.start.rel_mae if result.start else None,
        "best_epoch": result.best_epoch,
        "seconds": result.seconds,
    }
    horizon_s = configuration.steps / data.rate_hz
    edges_s = [horizon_s * quarter / QUARTERS for quarter in range(QUARTERS + 1)]
    for number, window in enumerate(sums.windows(data.rate_hz / data.stride, edges_s), 1):
        figures |= {f"rel_mse_q{number}": window.rel_mse, f"rel_mae_q{number}": window.rel_mae}
    return figures


def _read_row(file: Path) -> Row:
    try:
        return read(Row, json.loads(file.read_text(encoding="utf-8")), str(file))
    except ValueError as error:
        raise ValueError(f"{file}: not a row ({error}); delete it to measure the run again") from error


def default_runs() -> Path:
    """LEARNED_STRINGS_RUNS, else `runs` beside the project: a folder per run, with its checkpoint and log."""
    return Path(os.environ.get("LEARNED_STRINGS_RUNS", Path(__file__).parents[1] / "runs"))


def preset_info(
    configuration: TrainingConfiguration, dataset: Dataset, result: FitResult, errors: Mapping[str, Any]
) -> PresetInfo:
    """What the preset of a finished fit says of itself; `errors` as in a row."""
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
        knows=knowledge_of(configuration),
        seed=recipe.seed,
        **{name: errors[name] for name in REPEATED},
        training_seconds=result.seconds,
        training=write(configuration),
    )


def trained_range(data: DatasetConfiguration) -> TrainedRange:
    """What the random draws of a data set cover; noise has neither a place nor a width."""
    if data.initial == "pluck":
        position, width, peak_m = PLUCK_POSITION_RANGE, PLUCK_WIDTH_RANGE, PLUCK_PEAK_RANGE_M
        widths = {"gaussian": width, "raised_cosine": width}
        return TrainedRange(position, widths, peak_m, data.largest_tension_rise)
    if data.initial == "noise":
        return TrainedRange(None, None, PEAK_RANGE_M, data.largest_tension_rise)
    return TrainedRange(CENTRE_RANGE, {"gaussian": WIDTH_RANGE}, PEAK_RANGE_M, data.largest_tension_rise)
