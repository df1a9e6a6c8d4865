"""The untrained model of a run, made as its start says (`training.start`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import torch

from engine.bounds import LARGEST_HEADER_BYTES, LARGEST_PRESET_BYTES
from engine.models import build_model, read_model_configuration
from engine.models.base import Physics, StringModel
from engine.models.dmd import DMD
from training.configuration import TrainingConfiguration
from training.data.dataset import Dataset
from training.start import BLIND_PURSUIT, LEAST_SQUARES, PHASES, PURSUIT, STARTS

if TYPE_CHECKING:
    from training.fitting.pursuit import LatentFit

    Made = tuple[StringModel[Any], LatentFit | None]  # what the encoder shall learn first, if anything


def begin(configuration: TrainingConfiguration, dataset: Dataset) -> Made:
    """The untrained model of a run and its data set, by the run's start."""
    return _MAKERS.get(configuration.start, _own)(configuration, dataset)


def new_model(
    configuration: TrainingConfiguration, scale_m: float, counts: Mapping[str, int] | None = None
) -> StringModel[Any]:
    """The untrained model of a run, drawn from its seed; where another start is to come, by the model's default.

    Args:
        scale_m: its data set's.
        found: sizes that its data have set.
    """
    data = configuration.data
    model = build_model(configuration.model, {**configuration.model_configuration, **(counts or {})})
    size = LARGEST_HEADER_BYTES + sum(part.nbytes for part in model.state_dict().values())
    if size > LARGEST_PRESET_BYTES:
        raise ValueError(
            f"model_configuration makes a model of {size / 2**20:.0f} MiB, and a preset may have "
            f"{LARGEST_PRESET_BYTES / 2**20:g}; lower its widths"
        )
    how = model.own_initialisation() if configuration.start in STARTS else configuration.start
    generator = torch.Generator().manual_seed(configuration.recipe.seed)
    model.initialise(how, Physics(data.resonator, data.rate_hz, scale_m), generator)
    return model


def _own(configuration: TrainingConfiguration, dataset: Dataset) -> Made:
    return new_model(configuration, dataset.scale_m), None


def _least_squares(configuration: TrainingConfiguration, dataset: Dataset) -> Made:
    truth = dataset.split("train")[:, : configuration.steps + 1] @ dataset.synthesis.float()
    sizes = read_model_configuration("dmd", configuration.model_configuration, "model_configuration")
    return DMD.fit(truth, sizes), None


def _pursued(configuration: TrainingConfiguration, dataset: Dataset) -> Made:
    from training.fitting.pursuit import pursue  # and SciPy, which other starts do without

    model = new_model(configuration, dataset.scale_m)
    generator = torch.Generator().manual_seed(configuration.recipe.seed)
    return model, pursue(model, dataset, configuration.steps, generator, configuration.start == BLIND_PURSUIT)


def _from_phases(configuration: TrainingConfiguration, dataset: Dataset) -> Made:
    from training.fitting.modes import found_modes
    from training.fitting.phases import STORES, WIRED

    store = STORES.get(configuration.model)
    if store is None:
        raise ValueError(f"{configuration.title}: {WIRED}")
    modes = found_modes(dataset, configuration.steps)
    counted = configuration.model != "koopman_integrated" or "state_size" in configuration.model_configuration
    counts = None if counted else {"state_size": len(modes.shapes)}
    model = new_model(configuration, dataset.scale_m, counts)
    store(model, modes, configuration.recipe.seed)
    return model, None


_MAKERS: dict[str, Callable[[TrainingConfiguration, Dataset], Made]] = {
    LEAST_SQUARES: _least_squares,
    PURSUIT: _pursued,
    BLIND_PURSUIT: _pursued,
    PHASES: _from_phases,
}
assert set(_MAKERS) == set(STARTS)
