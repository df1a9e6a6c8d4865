"""The figures of both splits in a row of the results: errors, their standard errors, and the same over 400 frames."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from engine.metrics import ErrorSums
from engine.models.base import StringModel
from engine.presets import Preset, PresetError, PresetInfo, load_preset
from engine.schema import SchemaError
from training.configuration import DatasetConfiguration, TrainingConfiguration, read_configuration
from training.data.dataset import Dataset, load_dataset
from training.evaluate import evaluate_model
from training.results import SHORT_HORIZON, Row

PREFIXES = {"validation": "", "test": "test_"}
REPEATED = ("rel_mse", "rel_mae", "test_rel_mse", "test_rel_mae")
SAME = 1e-3  # relative; on another processor a float32 error of 1e-13 moves by less


def row_errors(
    model: StringModel[Any], dataset: Dataset, whole: Mapping[str, ErrorSums], steps: int
) -> dict[str, float | None]:
    """The columns of a row by name; None for an error that is infinite, and none over 400 frames of a shorter run.

    Args:
        whole: of "validation" and "test", over `steps` frames.
    """
    found: dict[str, float | None] = {}
    for split, prefix in PREFIXES.items():
        found |= _columns(prefix, "", whole[split])
        if steps >= SHORT_HORIZON and dataset.configuration.stride == 1:
            same = steps == SHORT_HORIZON
            short = whole[split] if same else evaluate_model(model, dataset, split, SHORT_HORIZON)
            found |= _columns(prefix, f"_{SHORT_HORIZON}", short)
    return found


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


def filled(row: Row, preset: Path, cache: Path | None = None) -> Row:
    """The row with the errors that it lacks, measured with its preset; what it has stays as it is.

    Raises:
        ValueError: the preset's errors are not the row's, so that it is of another run.
        PresetError, SchemaError, OSError: see `load_preset` and `load_dataset`.
    """
    loaded = load_preset(preset)
    configuration = configuration_of(loaded.info, str(preset))
    dataset = load_dataset(configuration.data, cache)
    whole = {split: evaluate_model(loaded.model, dataset, split, configuration.steps) for split in PREFIXES}
    measured = row_errors(loaded.model, dataset, whole, configuration.steps)
    for name in REPEATED:
        stored, again = getattr(row, name), measured[name]
        if stored is not None and (again is None or not math.isclose(stored, again, rel_tol=SAME)):
            raise ValueError(
                f"{preset}: its {name} is {again}, that of row {row.name} {stored}; it is of another run"
            )
    lacking: dict[str, Any] = {name: value for name, value in measured.items() if getattr(row, name) is None}
    return replace(row, **lacking)


def _columns(prefix: str, suffix: str, sums: ErrorSums) -> dict[str, float | None]:
    total, deviation = sums.total(), sums.standard_error()
    values = {
        f"{prefix}rel_mse{suffix}": total.rel_mse,
        f"{prefix}rel_mae{suffix}": total.rel_mae,
        f"{prefix}rel_mse{suffix}_se": deviation.rel_mse,
        f"{prefix}rel_mae{suffix}_se": deviation.rel_mae,
    }
    return {name: value if math.isfinite(value) else None for name, value in values.items()}
