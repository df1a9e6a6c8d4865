"""Tables of checked records in CSV: a line for each dataclass of texts and numbers, a default left empty."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

from engine.bounds import brief
from engine.schema import SchemaError, read
from engine.whole_file import whole_file

T = TypeVar("T")


def columns_of(kind: type) -> tuple[str, ...]:
    """The names of a record's columns."""
    return tuple(field.name for field in fields(kind))


def read_record(kind: type[T], columns: Sequence[str], texts: Sequence[str], where: str) -> T:
    """The record of a line.

    Args:
        columns: of the table, in the order of `texts`; `where` names the line in errors.

    Raises:
        SchemaError: another number of values, one that is no number, or one that `kind` refuses.
    """
    if len(texts) != len(columns):
        raise SchemaError(f"{where}: holds {len(texts)} values for {len(columns)} columns; restore the file")
    hints = get_type_hints(kind)
    values: dict[str, Any] = {}
    for name, text in zip(columns, texts, strict=True):
        number = next((each for each in (int, float) if each in (hints[name], *get_args(hints[name]))), None)
        if number is None:
            values[name] = text
        elif text:
            try:
                values[name] = number(text)
            except ValueError:
                raise SchemaError(f"{where}, column {name}: {brief(text)} is not a number") from None
    return read(kind, values, where)


def texts_of(record: Any) -> list[str]:
    """The values of a record's line, floats with all their digits; None is empty."""
    values = (getattr(record, name) for name in columns_of(type(record)))
    return ["" if value is None else str(value) for value in values]


def write_table(path: Path, kind: type, records: Iterable[Any]) -> None:
    """Writes a table whole or not at all. Raises OSError."""
    with whole_file(path) as unfinished, unfinished.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns_of(kind))
        writer.writerows(map(texts_of, records))
