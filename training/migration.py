"""Rows of earlier versions under the digests of this one.

A row is of a run as long as the configuration that its name means is the one that it was made with. Which that was
its digest says, by the rule of its time. So each earlier rule is kept here: a row whose name has that digest gets the
new one, and any other stays as it is, kept in the file and no figure of the tables.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from engine.schema import SchemaError, write
from training.by_name import load
from training.configuration import DATA_VERSION, TrainingConfiguration, digest_of, unlike_default
from training.results import Row


def earlier_digest(configuration: TrainingConfiguration) -> str:
    """By the first rule: a model's sizes as far as a file set them."""
    return digest_of(
        {
            "model": configuration.model,
            "model_configuration": write(configuration.model_configuration),
            "data": unlike_default(configuration.data),
            "data_version": DATA_VERSION,
            "recipe": unlike_default(configuration.recipe),
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
