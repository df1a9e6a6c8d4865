"""How a run's model starts. A start has a name, the knowledge of the string that it uses, in words, and its function.

Nothing here imports torch before a start is looked up: names of runs are read without it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from engine.bounds import LARGEST_HEADER_BYTES, LARGEST_PRESET_BYTES
from engine.models import build_model, model_class, read_model_configuration

if TYPE_CHECKING:
    from engine.models.base import StringModel
    from training.configuration import TrainingConfiguration
    from training.data.dataset import Dataset
    from training.fitting.pursuit import LatentFit

    Made = tuple[StringModel[Any], LatentFit | None]

LEAST_SQUARES = "least squares"  # how DMD is found: it is whole at once, and not trained
PURSUIT = "matching pursuit"  # see `fitting.pursuit`
BLIND_PURSUIT = "blind matching pursuit"
PHASES = "phases of the displacement"  # see `fitting.phases`
SYMMETRIES = "that a string may be mirrored and its sign turned"
COUNT = "how many modes it has"


class Start(NamedTuple):
    """A start.

    Attributes:
        given: the knowledge of the string's motion that it uses, in words; "": the displacement alone.
        make: the untrained model of a run and its data set, and what its encoder shall learn first, if anything.
        models: that have it.
    """

    given: str
    make: Callable[[TrainingConfiguration, Dataset], Made]
    models: tuple[str, ...]


def starts_of(model: str) -> dict[str, Start]:
    """The starts of a model by name; the first is the default. A model declares its own, whose weights it draws."""
    own = {how: Start(given, _own, (model,)) for how, given in model_class(model).initialisations.items()}
    found = {name: start for name, start in STARTS.items() if model in start.models}
    return found | own if LEAST_SQUARES in found else own | found


def given_to(model: str, start: str) -> str:
    """The knowledge that a start of a model uses, in words; "" for none, or for an unknown start."""
    found = starts_of(model).get(start)
    return found.given if found else ""


def hints_of(configuration: TrainingConfiguration) -> str:
    """The hints of a run whose start was found in the displacement, in words; empty for other runs."""
    if configuration.start not in (BLIND_PURSUIT, PHASES):
        return ""
    counted = configuration.model == "koopman_integrated" and "state_size" in configuration.model_configuration
    given = (SYMMETRIES if configuration.recipe.flip else "", COUNT if counted else "")
    return ", and ".join(words for words in given if words)


def knowledge_of(configuration: TrainingConfiguration) -> str:
    """The knowledge of the string that a run's start uses, in words; empty: the displacement alone."""
    return given_to(configuration.model, configuration.start) or hints_of(configuration)


def begin(configuration: TrainingConfiguration, dataset: Dataset) -> Made:
    """As `Start.make`, by the run's own start."""
    return starts_of(configuration.model)[configuration.start].make(configuration, dataset)


def new_model(
    configuration: TrainingConfiguration, scale_m: float, found: Mapping[str, int] | None = None
) -> StringModel[Any]:
    """The untrained model of a run, drawn from its seed; where another start is to come, by the model's default.

    Args:
        scale_m: its data set's.
        found: sizes that its data have set.
    """
    import torch

    from engine.models.base import Physics

    data = configuration.data
    model = build_model(configuration.model, {**configuration.model_configuration, **(found or {})})
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
    import torch

    from engine.models.dmd import DMD

    synthesis = torch.from_numpy(dataset.configuration.resonator.shapes / dataset.scale_m).float()
    truth = dataset.split("train")[:, : configuration.steps + 1] @ synthesis
    sizes = read_model_configuration("dmd", configuration.model_configuration, "model_configuration")
    return DMD.fit(truth, sizes), None


def _pursued(configuration: TrainingConfiguration, dataset: Dataset, *, blind: bool) -> Made:
    import torch

    from training.fitting.pursuit import pursue

    model = new_model(configuration, dataset.scale_m)
    generator = torch.Generator().manual_seed(configuration.recipe.seed)
    return model, pursue(model, dataset, configuration.steps, generator, blind)


def _from_phases(configuration: TrainingConfiguration, dataset: Dataset) -> Made:
    from training.fitting.modes import found_modes
    from training.fitting.phases import start_from_phases

    modes = found_modes(dataset, configuration.steps)
    counted = configuration.model != "koopman_integrated" or "state_size" in configuration.model_configuration
    found = None if counted else {"state_size": len(modes.shapes)}
    model = new_model(configuration, dataset.scale_m, found)
    start_from_phases(model, modes, configuration.recipe.seed)
    return model, None


# those that no model has by itself
STARTS = {
    LEAST_SQUARES: Start("", _least_squares, ("dmd",)),
    PURSUIT: Start(
        "the modes of the string and the range of their frequencies", partial(_pursued, blind=False), ("koopman",)
    ),
    BLIND_PURSUIT: Start("", partial(_pursued, blind=True), ("koopman",)),
    PHASES: Start("", _from_phases, ("koopman_integrated", "fgru", "frnn")),
}
