"""The starts of a run's model: names, and the knowledge of the string that each uses, in words.

A start is the way in which a model gets its first weights, before any training.
`training.fitting.start` makes the model.
Nothing here imports torch before a start is looked up: names of runs are read without it.
"""

from __future__ import annotations

from typing import NamedTuple

from engine.models import model_class

# names of starts
LEAST_SQUARES = "least squares"  # how a DMD (dynamic mode decomposition) is fitted at once; it is not trained
PURSUIT = "matching pursuit"  # see `fitting.pursuit`
BLIND_PURSUIT = "blind matching pursuit"  # the same from the displacement alone
PHASES = "phases of the displacement"  # see `fitting.phases`
# hints in words, see `TrainingConfiguration.hints`
SYMMETRIES = "that a string may be mirrored and its sign turned"
COUNT = "how many modes it has"


class Start(NamedTuple):
    """A start, without its name.

    Attributes:
        given: the knowledge of the string's motion that it uses, in words; "": the displacement alone.
        models: names of the models that can start so, as in `engine.models.MODELS`.
    """

    given: str
    models: tuple[str, ...]


# by name, those that are made here from the training data; all others draw or compute weights in the model itself
STARTS = {
    LEAST_SQUARES: Start("", ("dmd",)),
    PURSUIT: Start("the modes of the string and the range of their frequencies", ("koopman",)),
    BLIND_PURSUIT: Start("", ("koopman",)),
    PHASES: Start("", ("koopman_integrated", "fgru", "frnn")),
}


def starts_of(model: str) -> dict[str, Start]:
    """The starts of a model by name; the first is the default.

    They are those that its class declares as `initialisations`, then those of `STARTS`; a DMD has the latter first.
    """
    of_model = {how: Start(uses, (model,)) for how, uses in model_class(model).initialisations.items()}
    # of STARTS
    general = {name: start for name, start in STARTS.items() if model in start.models}
    return general | of_model if LEAST_SQUARES in general else of_model | general


def given_to(model: str, start: str) -> str:
    """The knowledge that a start of a model uses, in words; "" for none, or for an unknown start."""
    start_entry = starts_of(model).get(start)
    return start_entry.given if start_entry else ""
