"""The figures of both splits in a row of the results.

They are errors, their standard errors, and the same over 400 frames.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from engine.compare.relative import ErrorSums
from engine.models.base import StringModel
from engine.presets import Preset, PresetError, PresetInfo
from engine.schema import SchemaError
from training.configuration import DatasetConfiguration, TrainingConfiguration, read_configuration
from training.data.dataset import Dataset
from training.evaluate import evaluate_model
from training.results import SHORT_HORIZON

PREFIXES = {"validation": "", "test": "test_"}
REPEATED = ("rel_mse", "rel_mae", "test_rel_mse", "test_rel_mae")


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
        columns |= _columns(prefix, "", whole[split])
        if steps >= SHORT_HORIZON and dataset.configuration.stride == 1:
            same = steps == SHORT_HORIZON
            short = whole[split] if same else evaluate_model(model, dataset, split, SHORT_HORIZON)
            columns |= _columns(prefix, f"_{SHORT_HORIZON}", short)
    return columns


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


def _columns(prefix: str, suffix: str, sums: ErrorSums) -> dict[str, float | None]:
    total, deviation = sums.total(), sums.standard_error()
    values = {
        f"{prefix}rel_mse{suffix}": total.rel_mse,
        f"{prefix}rel_mae{suffix}": total.rel_mae,
        f"{prefix}rel_mse{suffix}_se": deviation.rel_mse,
        f"{prefix}rel_mae{suffix}_se": deviation.rel_mae,
    }
    return {name: value if math.isfinite(value) else None for name, value in values.items()}
