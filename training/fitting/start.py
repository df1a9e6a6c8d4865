"""The untrained model of a run, made as its start says (`training.start`)."""

from __future__ import annotations

from collections.abc import Mapping
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


def begin(configuration: TrainingConfiguration, dataset: Dataset) -> tuple[StringModel[Any], LatentFit | None]:
    """The untrained model of a run, by its start, and what its encoder shall learn first, if anything."""
    start, steps = configuration.start, configuration.steps
    if start == LEAST_SQUARES:
        truth = dataset.split("train")[:, : steps + 1] @ dataset.synthesis.float()
        sizes = read_model_configuration("dmd", configuration.model_configuration, "model_configuration")
        return DMD.fit(truth, sizes), None
    if start == PHASES:
        return _from_phases(configuration, dataset), None
    model = new_model(configuration, dataset.scale_m)
    if start not in (PURSUIT, BLIND_PURSUIT):
        return model, None
    from training.fitting.pursuit import pursue  # and SciPy, which other starts do without

    generator = torch.Generator().manual_seed(configuration.recipe.seed)
    return model, pursue(model, dataset, steps, generator, start == BLIND_PURSUIT)


def new_model(
    configuration: TrainingConfiguration, scale_m: float, counts: Mapping[str, int] | None = None
) -> StringModel[Any]:
    """The untrained model of a run, drawn from its seed; where another start is to come, by the model's default.

    Args:
        scale_m: its data set's.
        counts: sizes that its data have set.
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


def _from_phases(configuration: TrainingConfiguration, dataset: Dataset) -> StringModel[Any]:
    """The model of a run that starts from the displacement alone, see `phases`; as many modes as are found."""
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
    return model
