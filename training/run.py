"""A whole run: fit, errors, preset, and the preset read back and measured again."""

from __future__ import annotations

import csv
import math
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import torch

from engine.excitation import CENTRE_RANGE, PEAK_RANGE_M, WIDTH_RANGE
from engine.metrics import RelativeError
from engine.models import MODELS
from engine.preset import Preset, PresetInfo, TrainedRange, load_preset, save_preset
from engine.schema import read, write
from training.configuration import TrainingConfiguration
from training.dataset import Dataset
from training.evaluate import evaluate_model
from training.fit import FitResult, Progress, fit

LOG_FIELDS = ("epoch", "horizon", "learning_rate", "loss", "rel_mse", "rel_mae", "seconds")
REPEAT_TOLERANCE = 1e-5  # relative; a sum in another order moves a float32 error by less


@dataclass(frozen=True)
class TrainedPreset:
    """A run's result: the preset as read back from its file, and the errors measured with it."""

    preset: Preset
    validation: RelativeError
    test: RelativeError
    best_epoch: int
    seconds: float


def train(
    configuration: TrainingConfiguration,
    dataset: Dataset,
    output: Path,
    run_folder: Path,
    *,
    device: torch.device | str = "cpu",
    report: Callable[[Progress], None] = lambda progress: None,
) -> TrainedPreset:
    """Makes the preset `output`; goes on with the run in `run_folder` where one was interrupted.

    Args:
        dataset: of `configuration.data`.
        report: called after every epoch, which is in `run_folder`/log.csv by then.

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
        log.add(progress)
        report(progress)

    result = fit(configuration, dataset, run_folder, device=device, report=log_and_report)
    result = replace(result, model=result.model.cpu())
    info = preset_info(configuration, dataset, result)
    save_preset(output, info, result.model)
    preset = load_preset(output)
    validation, test = (evaluate_model(preset.model, dataset, split).total() for split in ("validation", "test"))
    _check_repeats(info, validation, test, output)
    return TrainedPreset(preset, validation, test, result.best_epoch, result.seconds)


def default_runs() -> Path:
    """LEARNED_STRINGS_RUNS, else `runs` beside the project: a folder per run, with its checkpoint and log."""
    return Path(os.environ.get("LEARNED_STRINGS_RUNS", Path(__file__).parents[1] / "runs"))


def preset_info(configuration: TrainingConfiguration, dataset: Dataset, result: FitResult) -> PresetInfo:
    """What the preset of a finished fit says of itself, its errors measured here."""
    data, recipe = configuration.data, configuration.recipe
    sizes: object = read(MODELS[configuration.model][1], configuration.model_configuration, "model_configuration")
    validation, test = (evaluate_model(result.model, dataset, split).total() for split in ("validation", "test"))
    return PresetInfo(
        title=configuration.title,
        description=configuration.description,
        model=configuration.model,
        model_configuration=write(sizes),
        string=data.string,
        tension_modulated=data.tension_modulated,
        initial=data.initial,
        rate_hz=data.rate_hz,
        modes=data.modes,
        grid_points=data.grid_points,
        horizon_steps=data.steps,
        scale_m=dataset.scale_m,
        trained_range=trained_range(data.initial),
        initialisation=recipe.initialisation or result.model.initialisations[0],
        seed=recipe.seed,
        rel_mse=validation.rel_mse,
        rel_mae=validation.rel_mae,
        test_rel_mse=test.rel_mse,
        test_rel_mae=test.rel_mae,
        training_seconds=result.seconds,
        training=write(configuration),
    )


def trained_range(initial: str) -> TrainedRange:
    """What the random draws of a kind cover; noise has neither a place nor a width."""
    if initial == "noise":
        return TrainedRange(None, None, PEAK_RANGE_M)
    return TrainedRange(CENTRE_RANGE, WIDTH_RANGE, PEAK_RANGE_M)


class TrainingLog:
    """A CSV file with one line per epoch, also across interruptions.

    A run continues from its checkpoint, which may be older than its last line: lines from the first epoch
    that comes on are dropped before it is added.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._trimmed = False

    def add(self, progress: Progress) -> None:
        if not self._trimmed:
            self._keep_before(progress.epoch)
            self._trimmed = True
        with self._path.open("a", newline="", encoding="utf-8") as file:
            csv.writer(file).writerow(_row(progress))

    def _keep_before(self, epoch: int) -> None:
        kept = []
        if self._path.exists():
            with self._path.open(newline="", encoding="utf-8") as file:
                kept = [row for row in csv.reader(file) if _is_whole(row) and int(row[0]) < epoch]
        self._path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = self._path.with_suffix(f".{os.getpid()}.unfinished")
        try:
            with unfinished.open("w", newline="", encoding="utf-8") as file:
                csv.writer(file).writerows([LOG_FIELDS, *kept])
            unfinished.replace(self._path)
        finally:
            unfinished.unlink(missing_ok=True)


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
    again = (validation.rel_mse, validation.rel_mae, test.rel_mse, test.rel_mae)
    for before, after in zip(stored, again, strict=True):
        if before is None or not math.isclose(before, after, rel_tol=REPEAT_TOLERANCE):
            raise RuntimeError(f"{output}: measures {after} where the trained model had {before}; train it again")
