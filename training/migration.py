"""Rows of earlier versions under the digests of this one.

A row is of a run as long as the configuration that its name means is the one that it was made with. Which that was
its digest says, by the rule of its time. So each earlier rule is kept here: a row whose name has that digest gets the
new one, and any other stays as it is, kept in the file and no figure of the tables.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from engine.models import RETIRED, model_class, read_model_configuration
from engine.schema import SchemaError, write
from training.cell import load
from training.configuration import DATA_VERSION, TrainingConfiguration, digest_of, non_default
from training.results import Row
from training.start import BLIND_PURSUIT, PHASES, STARTS


def earlier_digest(configuration: TrainingConfiguration) -> str:
    """By the second rule: a start had a name where it was the model's own, and flags for others."""
    start, model, given = configuration.start, configuration.model, configuration.model_configuration
    recipe = {name: value for name, value in non_default(configuration.recipe).items() if name != "start"}
    recipe["initialisation"] = model_class(model).own_initialisation() if start in STARTS else start
    if start in (BLIND_PURSUIT, PHASES):
        recipe["blind"] = True
    if start == PHASES and model == "koopman_integrated" and "state_size" not in given:
        recipe["latents_per_mode"] = 1
    sizes = write(read_model_configuration(model, given, "model_configuration"))
    return digest_of(
        {
            "digest_version": 2,
            "model": model,
            "model_configuration": sizes | RETIRED.get(model, {}),
            "data": non_default(configuration.data),
            "data_version": DATA_VERSION,
            "recipe": recipe,
            "horizon": configuration.steps,
        }
    )


def carried_over(row: Row, configuration: TrainingConfiguration) -> Row:
    """The row of a run under its present digest, where it has an earlier one; else as it is."""
    return replace(row, digest=configuration.digest) if row.digest == earlier_digest(configuration) else row


def migrated(rows: Iterable[Row]) -> list[Row]:
    """All rows in their order; see the module."""
    return [_migrated(row) for row in rows]


def _migrated(row: Row) -> Row:
    try:
        return carried_over(row, load(row.name))
    except SchemaError:  # a name that means nothing any more
        return row
