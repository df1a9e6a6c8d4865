"""Figures of a benchmark as tables or JSON: one printer for all dataclasses that benchmarks return."""

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


def show(found: Mapping[str, Any], as_json: bool) -> None:
    """Print figures by name: the machine, dataclasses, tuples of dataclasses, numbers. Properties count as fields."""
    if as_json:
        print_json(plain(found))
        return
    single: dict[str, Any] = {}
    for name, value in found.items():
        if name == "machine":
            print(", ".join(f"{_label(field)} {entry}" for field, entry in plain(value).items()))
        elif isinstance(value, tuple) and value and is_dataclass(value[0]):
            _print_records([_flat(plain(each)) for each in value], _targets(value[0]))
        elif is_dataclass(value):
            _print_rows([""], [_flat(plain(value))], _targets(value))
        else:
            single[name] = plain(value)
    if single:
        _print_rows([""], [_flat(single)], {})


def plain(value: Any) -> Any:
    """Dataclasses with their public properties as mappings, tuples as lists."""
    if is_dataclass(value):
        properties = [name for name, entry in vars(type(value)).items() if isinstance(entry, property)]
        return {name: plain(getattr(value, name)) for name in (*(each.name for each in fields(value)), *properties)}
    if isinstance(value, Mapping):
        return {name: plain(entry) for name, entry in value.items()}
    return [plain(entry) for entry in value] if isinstance(value, list | tuple) else value


def _print_records(records: list[dict[str, Any]], targets: Mapping[str, object]) -> None:
    """Print a column per field, or, for records of many fields, a row per field."""
    names = list(records[0])
    if len(names) <= MOST_COLUMNS:
        print_table([_label(name) for name in names], [tuple(record[name] for name in names) for record in records])
    else:
        _print_rows([str(record[names[0]]) for record in records], records, targets)


def _print_rows(heads: list[str], records: list[dict[str, Any]], targets: Mapping[str, object]) -> None:
    rows = [(_label(name), *(record[name] for record in records)) for name in records[0]]
    columns = ["", *heads]
    if targets:
        columns.append("target")
        rows = [(*row, targets.get(name)) for row, name in zip(rows, records[0], strict=True)]
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
    return {each.name: each.metadata[TARGET] for each in fields(found) if TARGET in each.metadata}
