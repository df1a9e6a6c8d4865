"""Tables of checked records in CSV: a line for each dataclass of texts and numbers, a default left empty."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

from engine.bounds import brief
from engine.schema import SchemaError, read
from engine.whole_file import UnusableFile, naming, read_bounded, whole_file

T = TypeVar("T")


def columns_of(kind: type) -> tuple[str, ...]:
    """The names of a record's columns."""
    return tuple(field.name for field in fields(kind))


def read_table(
    kind: type[T], path: Path, what: str, most_bytes: int, *, lines_apart: bool = False
) -> Iterator[T | SchemaError]:
    """The records of a table in order, and an error in place of a line that holds none.

    Columns with a default may be missing.

    Args:
        what: the name of such a table, for errors.
        lines_apart: no value holds a line break, so that an open quote spoils one line only.

    Raises:
        SchemaError: it is no such table, or has a column of a newer version.
        OSError: it cannot be read.
    """
    known = columns_of(kind)
    try:
        lines = io.StringIO(read_bounded(path, most_bytes).decode("utf-8"), newline="")
    except UnusableFile as error:
        raise SchemaError(f"{path}: {error.strerror}; remove it") from error
    except UnicodeDecodeError as error:
        raise SchemaError(f"{path}: not a {what}: not a text file; restore it, or remove it") from error
    rows = _rows(lines, lines_apart)
    columns = next(rows, [])
    if isinstance(columns, SchemaError):
        raise SchemaError(f"{path}: not a {what}: {columns}")
    if known[0] not in columns:
        raise SchemaError(f"{path}: not a {what}: its first line must name {', '.join(known[:3])}, …")
    if unknown := sorted(set(columns) - set(known)):
        raise SchemaError(f"{path}: unknown column {unknown[0]!r}; it is of a newer version: update this program")
    for number, row in enumerate(rows, 2):
        where = f"{path}: line {number}"
        try:
            if isinstance(row, SchemaError):
                raise SchemaError(f"{where}: {row}")
            record = _record(kind, columns, row, where)
        except SchemaError as error:
            yield error
        else:
            yield record


def checked(records: Iterable[T | SchemaError]) -> Iterator[T]:
    """The records of `read_table`. Raises SchemaError at the first line that holds none."""
    for record in records:
        if isinstance(record, SchemaError):
            raise record
        yield record


def _rows(lines: io.StringIO, apart: bool) -> Iterator[list[str] | SchemaError]:
    """The values of each line, the columns' names first, or an error in place of a line that is not CSV.

    Args:
        apart: read every line by itself, so that no value goes past its end.
    """

    def values_of(line: str) -> list[str]:
        return next(csv.reader([line]), [])

    reader = map(values_of, lines) if apart else csv.reader(lines)  # a map continues after an error
    while True:
        try:
            yield next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            yield SchemaError(f"not a line of values ({error})")


def _record(kind: type[T], columns: Sequence[str], texts: Sequence[str], where: str) -> T:
    """The record of a line. `where` names it in errors.

    Raises:
        SchemaError: another number of values, one that is no number, or one that `kind` refuses.
    """
    if len(texts) != len(columns):
        raise SchemaError(f"{where}: holds {len(texts)} values for {len(columns)} columns; restore the file")
    hints = get_type_hints(kind)
    values: dict[str, Any] = {}
    for name, text in zip(columns, texts, strict=True):
        number = next(
            (number_kind for number_kind in (int, float) if number_kind in (hints[name], *get_args(hints[name]))),
            None,
        )
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
    """Write a table whole or not at all. Raises OSError."""
    with whole_file(path) as unfinished, unfinished.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns_of(kind))
        writer.writerows(map(texts_of, records))


def append_record(path: Path, record: Any) -> None:
    """Add a line to a table. Raises OSError."""
    with naming(path), path.open("a", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerow(texts_of(record))
