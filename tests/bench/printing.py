"""Results of a benchmark as tables or JSON: one printer for every dataclass that a benchmark returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from training.cli.console import number, print_json, print_table

MOST_COLUMNS = 12  # a list of records with more fields is printed with a row per field
MOST_VALUES = 8  # of a list in one cell
TARGET = "target"
UNITS = {"s": "s", "ms": "ms", "us": "µs", "db": "dB", "hz": "Hz", "mib": "MiB", "cents": "cents"}


def target(value: object) -> dict[str, object]:
    """Metadata of a dataclass field with a target, which the tables show."""
    return {TARGET: value}


def show(found: Any, as_json: bool) -> None:
    """Print what a benchmark measured.

    Args:
        found: a dataclass: the machine, figures, and tuples of dataclasses, of which each becomes a table. Its
            properties are printed too.
    """
    values = plain(found)
    if as_json:
        print_json(values)
        return
    machine = values.pop("machine")
    print(", ".join(f"{_label(name)} {value}" for name, value in machine.items()))
    own, targets = {}, _targets(found)
    for name, value in values.items():
        entries = getattr(found, name)
        if isinstance(entries, tuple) and entries and is_dataclass(entries[0]):
            _print_records([_flat(entry) for entry in value], _targets(entries[0]))
        else:
            own.update(_flat({name: value}))
    if own:
        _print_records([own], targets, always_rows=True)


def plain(value: Any) -> Any:
    """Dataclasses with their public properties as mappings, tuples as lists."""
    if is_dataclass(value):
        properties = [name for name, entry in vars(type(value)).items() if isinstance(entry, property)]
        return {name: plain(getattr(value, name)) for name in (*(each.name for each in fields(value)), *properties)}
    if isinstance(value, Mapping):
        return {name: plain(entry) for name, entry in value.items()}
    return [plain(entry) for entry in value] if isinstance(value, list | tuple) else value


def _print_records(records: list[dict[str, Any]], targets: Mapping[str, object], always_rows: bool = False) -> None:
    """A table with a column per field, or, for records of many fields, a row per field."""
    names = list(records[0])
    if not always_rows and len(names) <= MOST_COLUMNS:
        print_table([_label(name) for name in names], [tuple(record[name] for name in names) for record in records])
        return
    rows = [(_label(name), *(record[name] for record in records)) for name in names]
    columns = ["", *(str(record[names[0]]) for record in records)] if not always_rows else ["", "here"]
    if targets:
        columns.append("target")
        rows = [(*row, targets.get(name)) for row, name in zip(rows, names, strict=True)]
    print_table(columns, rows)


def _flat(values: Mapping[str, Any]) -> dict[str, Any]:
    """Nested mappings with their names joined, lists of numbers in one cell."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            found.update({f"{name}, {inner}": entry for inner, entry in _flat(value).items()})
        elif isinstance(value, list):
            texts = [number(entry) if isinstance(entry, float) else str(entry) for entry in value]
            more = [f"and {len(texts) - MOST_VALUES} more"] if len(texts) > MOST_VALUES else []
            found[name] = ", ".join([*texts[:MOST_VALUES], *more])
        else:
            found[name] = {True: "yes", False: "no"}[value] if isinstance(value, bool) else value
    return found


def _label(name: str) -> str:
    """`longest_hole_ms` as "longest hole, ms"; so each part of joined names."""
    parts = []
    for part in name.split(", "):
        *words, last = part.split("_")
        parts.append(f"{' '.join(words)}, {UNITS[last]}" if words and last in UNITS else part.replace("_", " "))
    return ", ".join(parts)


def _targets(found: Any) -> dict[str, object]:
    """Targets by the names that `_flat` gives; those of nested dataclasses too."""
    targets = {}
    for each in fields(found):
        value = getattr(found, each.name)
        if TARGET in each.metadata:
            targets[each.name] = each.metadata[TARGET]
        if is_dataclass(value):
            targets.update({f"{each.name}, {name}": entry for name, entry in _targets(value).items()})
    return targets
