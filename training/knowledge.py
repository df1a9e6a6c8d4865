"""How a run's model starts, and what that start is given of the string, in words: presets and tables print them."""

from __future__ import annotations

from engine.models import MODELS
from training.configuration import TrainingConfiguration

LEAST_SQUARES = "least squares"  # how DMD is found: it has no start
PURSUIT = "matching pursuit"  # see `fitting.pursuit`
BLIND_PURSUIT = "blind matching pursuit"
PHASES = "phases of the displacement"  # see `fitting.phases`

# what the starts that no model has by itself are given of the string; a model declares that of its own
STARTS = {
    LEAST_SQUARES: "",
    PURSUIT: "the modes of the string and the range of their frequencies",
    BLIND_PURSUIT: "",
    PHASES: "",
}
SYMMETRIES = "that a string may be mirrored and its sign turned"
COUNT = "how many modes it has"


def own_start(configuration: TrainingConfiguration) -> str:
    """How the model is initialised before any fit: the recipe's choice, or its source's own."""
    return configuration.recipe.initialisation or MODELS[configuration.model][0].own_initialisation()


def initialisation_of(configuration: TrainingConfiguration) -> str:
    """How a run's model starts, as rows and presets name it."""
    if configuration.model == "dmd":
        return LEAST_SQUARES
    if configuration.recipe.latent_epochs:
        return BLIND_PURSUIT if configuration.recipe.blind else PURSUIT
    return PHASES if configuration.recipe.blind else own_start(configuration)


def given_to(model: str, start: str) -> str:
    """What a start of a model is given of the string's motion; "" for nothing, or a start that is not known."""
    return STARTS[start] if start in STARTS else MODELS[model][0].initialisations.get(start, "")


def hints_of(configuration: TrainingConfiguration) -> str:
    """What a run that found its start in the displacement was given beside it, in words; empty for other runs."""
    if initialisation_of(configuration) not in (BLIND_PURSUIT, PHASES):
        return ""
    counted = configuration.model == "koopman_integrated" and not configuration.recipe.latents_per_mode
    told = (SYMMETRIES if configuration.recipe.flip else "", COUNT if counted else "")
    return ", and ".join(words for words in told if words)


def knowledge_of(configuration: TrainingConfiguration) -> str:
    """What a run's start is given of the string, in words; empty: nothing but the displacement."""
    return given_to(configuration.model, initialisation_of(configuration)) or hints_of(configuration)
