"""A whole run: fit, errors, preset, and the preset read back and measured again."""

from __future__ import annotations

import csv
import json
import math
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from filelock import FileLock, Timeout

from engine.excitation import (
    CENTRE_RANGE,
    PEAK_RANGE_M,
    PLUCK_PEAK_RANGE_M,
    PLUCK_POSITION_RANGE,
    PLUCK_WIDTH_RANGE,
    WIDTH_RANGE,
)
from engine.metrics import ErrorSums, RelativeError
from engine.presets import Preset, PresetError, PresetInfo, TrainedRange, load_preset, read_info, save_preset
from engine.schema import SchemaError, read, write
from engine.whole_file import naming, whole_file
from training import provenance
from training.configuration import DatasetConfiguration, TrainingConfiguration
from training.data.dataset import Dataset, load_dataset
from training.evaluate import evaluate_model
from training.fitting.fit import Diverged, FitResult, Progress, fit
from training.knowledge import initialisation_of, knowledge_of
from training.migration import carried_over
from training.results import QUARTERS, Row
from training.row_errors import configuration_of, row_errors

LOG_FIELDS = ("epoch", "horizon", "learning_rate", "loss", "rel_mse", "rel_mae", "seconds")
REPEAT_TOLERANCE = 1e-5  # relative; a sum in another order moves a float32 error by less


@dataclass(frozen=True)
class TrainedPreset:
    """A run's result: the preset as read back from its file, and the errors measured with it."""

    preset: Preset
    validation: ErrorSums
    test: ErrorSums
    result: FitResult


def train(
    configuration: TrainingConfiguration,
    dataset: Dataset,
    output: Path,
    run_folder: Path,
    *,
    device: torch.device | str = "cpu",
    report: Callable[[Progress], None] = lambda progress: None,
    checkpoint_every_s: float | None = None,
) -> TrainedPreset:
    """Makes the preset `output`; goes on with the run in `run_folder` where one was interrupted.

    Args:
        dataset: of `configuration.data`.
        report: see `fit`. An epoch is in `run_folder`/log.csv when it is told; the run ends with a plot, log.png.

    Raises:
        Diverged, ValueError: see `fit`.
        RuntimeError: the preset that was written does not measure as the model that was trained.
        OSError: a folder cannot be written.
    """
    output.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=output.parent):
        pass  # a folder that cannot be written is told before the work
    log = TrainingLog(run_folder / "log.csv")

    def log_and_report(progress: Progress) -> None:
        if progress.ends_epoch:
            log.add(progress)
        report(progress)

    try:
        result = fit(
            configuration,
            dataset,
            run_folder,
            device=device,
            report=log_and_report,
            checkpoint_every_s=checkpoint_every_s,
        )
    except Diverged:
        _plot(log.path)
        raise
    _plot(log.path)
    result = replace(result, model=result.model.cpu())
    info = preset_info(configuration, dataset, result)
    save_preset(output, info, result.model)
    preset = load_preset(output)
    validation, test = (
        evaluate_model(preset.model, dataset, split, configuration.steps) for split in ("validation", "test")
    )
    _check_repeats(info, validation.total(), test.total(), output)
    return TrainedPreset(preset, validation, test, result)


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
        waits: is told where another process trains in that folder, whose end is awaited.

    Raises:
        ValueError, RuntimeError, OSError: see `train`.
    """
    folder = runs / name
    folder.mkdir(parents=True, exist_ok=True)
    # never two in one folder, even where a worker that was taken for dead still trains
    with _held(folder / "run.lock", waits):
        file = folder / "row.json"
        output = preset or folder / f"{name}.safetensors"
        known = carried_over(_read_row(file), configuration) if file.exists() else None
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
            "initialisation": initialisation_of(configuration),
            "device": torch.device(device).type,
            "threads": torch.get_num_threads(),
            "hardware": provenance.hardware(device),
            "torch": torch.__version__,
            "commit": provenance.commit(),
        }
        try:
            trained = train(
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
        row = Row(**facts, status="done", finished=provenance.now(), **_figures(trained, dataset))
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


def _figures(trained: TrainedPreset, dataset: Dataset) -> dict[str, Any]:
    """The errors of a run and what it took, as a row names them."""
    info, result, sums = trained.preset.info, trained.result, trained.validation
    spread = sums.spread()
    figures: dict[str, Any] = {
        **row_errors(
            trained.preset.model,
            dataset,
            {"validation": trained.validation, "test": trained.test},
            info.horizon_steps,
        ),
        "rel_mse_spread": spread.rel_mse,
        "rel_mae_spread": spread.rel_mae,
        "parameters": trained.preset.parameters,
        "epochs": result.epochs,
        "start_rel_mse": result.start.rel_mse if result.start else None,
        "start_rel_mae": result.start.rel_mae if result.start else None,
        "best_epoch": result.best_epoch,
        "seconds": result.seconds,
    }
    edges_s = [info.horizon_s * quarter / QUARTERS for quarter in range(QUARTERS + 1)]
    for number, window in enumerate(sums.windows(info.rate_hz / dataset.configuration.stride, edges_s), 1):
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


def preset_info(configuration: TrainingConfiguration, dataset: Dataset, result: FitResult) -> PresetInfo:
    """What the preset of a finished fit says of itself, its errors measured here."""
    data, recipe = configuration.data, configuration.recipe
    validation, test = (
        evaluate_model(result.model, dataset, split, configuration.steps).total() for split in ("validation", "test")
    )
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
        initialisation=initialisation_of(configuration),
        knows=knowledge_of(configuration),
        seed=recipe.seed,
        rel_mse=validation.rel_mse,
        rel_mae=validation.rel_mae,
        test_rel_mse=_finite(test.rel_mse),
        test_rel_mae=_finite(test.rel_mae),
        training_seconds=result.seconds,
        training=write(configuration),
    )


def _finite(error: float) -> float | None:
    """None for a model that runs away on a trajectory of the test set, though on none of the validation set."""
    return error if math.isfinite(error) else None


def trained_range(data: DatasetConfiguration) -> TrainedRange:
    """What the random draws of a data set cover; noise has neither a place nor a width."""
    if data.initial == "pluck":
        position, width, peak_m = PLUCK_POSITION_RANGE, PLUCK_WIDTH_RANGE, PLUCK_PEAK_RANGE_M
        widths = {"gaussian": width, "raised_cosine": width}
        return TrainedRange(position, widths, peak_m, data.largest_tension_rise)
    if data.initial == "noise":
        return TrainedRange(None, None, PEAK_RANGE_M, data.largest_tension_rise)
    return TrainedRange(CENTRE_RANGE, {"gaussian": WIDTH_RANGE}, PEAK_RANGE_M, data.largest_tension_rise)


class TrainingLog:
    """A CSV file with one line per epoch, also across interruptions.

    A run continues from its checkpoint, which may be older than its last line: lines from the first epoch
    that comes on are dropped before it is added.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._trimmed = False

    def add(self, progress: Progress) -> None:
        if not self._trimmed:
            self._keep_before(progress.epoch)
            self._trimmed = True
        with naming(self.path), self.path.open("a", newline="", encoding="utf-8") as file:
            csv.writer(file).writerow(_row(progress))

    def _keep_before(self, epoch: int) -> None:
        kept = []
        if self.path.exists():
            with self.path.open(newline="", encoding="utf-8") as file:
                kept = [row for row in csv.reader(file) if _is_whole(row) and int(row[0]) < epoch]
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(self.path) as unfinished, unfinished.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([LOG_FIELDS, *kept])


def _plot(log: Path) -> None:
    """A picture of the run beside its log; none where it ended before its first epoch."""
    if not log.exists():
        return
    from training.figures.run_plot import plot_run  # Matplotlib only where there is something to draw

    plot_run(log, log.with_suffix(".png"))


def _row(progress: Progress) -> list[str]:
    validation = progress.validation
    return [
        str(progress.epoch),
        str(progress.horizon),
        f"{progress.learning_rate:.6g}",
        f"{progress.loss:.6g}",
        f"{validation.rel_mse:.6g}" if validation else "",
        f"{validation.rel_mae:.6g}" if validation else "",
        f"{progress.seconds:.2f}",
    ]


def _is_whole(row: list[str]) -> bool:
    """Whether it is a line of an epoch; a run that was killed may leave half of one."""
    return len(row) == len(LOG_FIELDS) and row[0].isdigit() and row[-1] != ""


def _check_repeats(info: PresetInfo, validation: RelativeError, test: RelativeError, output: Path) -> None:
    stored = (info.rel_mse, info.rel_mae, info.test_rel_mse, info.test_rel_mae)
    again = (validation.rel_mse, validation.rel_mae, _finite(test.rel_mse), _finite(test.rel_mae))
    for before, after in zip(stored, again, strict=True):
        if before is None and after is None:
            continue
        if before is None or after is None or not math.isclose(before, after, rel_tol=REPEAT_TOLERANCE):
            raise RuntimeError(f"{output}: measures {after} where the trained model had {before}; train it again")
