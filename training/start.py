"""How a run's model starts: by name, what that start is given of the string, in words, and what makes it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import torch

from engine.bounds import LARGEST_HEADER_BYTES, LARGEST_PRESET_BYTES
from engine.models import DMD, MODELS, StringModel, build_model, read_model_configuration
from engine.models.base import Physics
from training.configuration import TrainingConfiguration

if TYPE_CHECKING:
    from training.data.dataset import Dataset
    from training.fitting.pursuit import LatentFit

LEAST_SQUARES = "least squares"  # how DMD is found: it is whole at once, and not trained
PURSUIT = "matching pursuit"  # see `fitting.pursuit`
BLIND_PURSUIT = "blind matching pursuit"
PHASES = "phases of the displacement"  # see `fitting.phases`
SYMMETRIES = "that a string may be mirrored and its sign turned"
COUNT = "how many modes it has"


class Start(NamedTuple):
    """A start.

    Attributes:
        given: of the string's motion, in words; "": nothing but the displacement.
        make: the untrained model of a run and its data set, and what its encoder shall learn first, if anything.
    """

    given: str
    make: Callable[[TrainingConfiguration, Dataset], tuple[StringModel[Any], LatentFit | None]]


def initialisation_of(configuration: TrainingConfiguration) -> str:
    """The name of a run's start, as rows and presets have it."""
    recipe = configuration.recipe
    if configuration.model == "dmd":
        return LEAST_SQUARES
    if recipe.latent_epochs:
        return BLIND_PURSUIT if recipe.blind else PURSUIT
    return PHASES if recipe.blind else configuration.own_start


def given_to(model: str, start: str) -> str:
    """What a start of a model is given of the string's motion; "" for nothing, or a start that is not known."""
    return STARTS[start].given if start in STARTS else MODELS[model][0].initialisations.get(start, "")


def hints_of(configuration: TrainingConfiguration) -> str:
    """What a run that found its start in the displacement was given beside it, in words; empty for other runs."""
    if initialisation_of(configuration) not in (BLIND_PURSUIT, PHASES):
        return ""
    counted = configuration.model == "koopman_integrated" and not configuration.recipe.latents_per_mode
    given = (SYMMETRIES if configuration.recipe.flip else "", COUNT if counted else "")
    return ", and ".join(words for words in given if words)


def knowledge_of(configuration: TrainingConfiguration) -> str:
    """What a run's start is given of the string, in words; empty: nothing but the displacement."""
    return given_to(configuration.model, initialisation_of(configuration)) or hints_of(configuration)


def begin(configuration: TrainingConfiguration, dataset: Dataset) -> tuple[StringModel[Any], LatentFit | None]:
    """As `Start.make`, by the run's own start."""
    start = STARTS.get(initialisation_of(configuration))
    return start.make(configuration, dataset) if start else (new_model(configuration, dataset.scale_m), None)


def new_model(
    configuration: TrainingConfiguration, scale_m: float, found: Mapping[str, int] | None = None
) -> StringModel[Any]:
    """The untrained model of a run by its own start, drawn from its seed.

    Args:
        scale_m: its data set's.
        found: sizes that its data have set.
    """
    data = configuration.data
    model = build_model(configuration.model, {**configuration.model_configuration, **(found or {})})
    size = LARGEST_HEADER_BYTES + sum(part.nbytes for part in model.state_dict().values())
    if size > LARGEST_PRESET_BYTES:
        raise ValueError(
            f"model_configuration makes a model of {size / 2**20:.0f} MiB, and a preset may have "
            f"{LARGEST_PRESET_BYTES / 2**20:g}; lower its widths"
        )
    model.initialise(
        configuration.own_start,
        Physics(data.resonator, data.rate_hz, scale_m),
        torch.Generator().manual_seed(configuration.recipe.seed),
    )
    return model


def _least_squares(configuration: TrainingConfiguration, dataset: Dataset) -> tuple[StringModel[Any], None]:
    synthesis = (dataset.configuration.resonator.shapes / dataset.scale_m).float()
    truth = dataset.split("train")[:, : configuration.steps + 1] @ synthesis
    sizes = read_model_configuration("dmd", configuration.model_configuration, "model_configuration")
    return DMD.fit(truth, sizes), None


def _pursued(configuration: TrainingConfiguration, dataset: Dataset) -> tuple[StringModel[Any], LatentFit]:
    from training.fitting.pursuit import pursue

    recipe, model = configuration.recipe, new_model(configuration, dataset.scale_m)
    generator = torch.Generator().manual_seed(recipe.seed)
    return model, pursue(model, dataset, configuration.steps, generator, recipe.blind)


def _from_phases(configuration: TrainingConfiguration, dataset: Dataset) -> tuple[StringModel[Any], None]:
    from training.fitting.modes import found_modes
    from training.fitting.phases import start_from_phases

    modes = found_modes(dataset, configuration.steps)
    each = configuration.recipe.latents_per_mode
    found = {"state_size": each * len(modes.shapes)} if each else None
    model = new_model(configuration, dataset.scale_m, found)
    start_from_phases(model, modes, configuration.recipe.seed)
    return model, None


# those that no model has by itself; a model declares what its own are given, and makes them
STARTS = {
    LEAST_SQUARES: Start("", _least_squares),
    PURSUIT: Start("the modes of the string and the range of their frequencies", _pursued),
    BLIND_PURSUIT: Start("", _pursued),
    PHASES: Start("", _from_phases),
}
