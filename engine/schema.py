"""Checked reading of plain data (JSON, TOML) into frozen dataclasses, and back.

Every error names the place, the field and the remedy. Types are read from the annotations; supported are
bool, int, float, str, Literal, None unions, tuples of one type, string-keyed mappings and nested dataclasses.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import types
from collections.abc import Mapping
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

T = TypeVar("T")


class SchemaError(ValueError):
    """Data that does not fit its description."""


def read(kind: type[T], data: object, where: str) -> T:
    """An instance of the dataclass `kind` from the mapping `data`; `where` names it in errors.

    Raises:
        SchemaError: a field is unknown, missing, of another type, or refused by the dataclass itself.
    """
    if not isinstance(data, Mapping):
        raise SchemaError(f"{where}: expected a table of fields, found {_describe(data)}")
    fields = {f.name: f for f in dataclasses.fields(kind) if f.init}  # type: ignore[arg-type]
    unknown = sorted(set(data) - set(fields))
    if unknown:
        raise SchemaError(f"{where}: unknown field {unknown[0]!r}; known are {', '.join(fields)}")
    hints = _type_hints(kind)  # type: ignore[arg-type]
    values = {}
    for name, field in fields.items():
        if name in data:
            values[name] = _convert(hints[name], data[name], f"{where}.{name}")
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise SchemaError(f"{where}: field {name!r} is missing")
    try:
        return kind(**values)
    except SchemaError:
        raise
    except (ValueError, TypeError) as error:
        raise SchemaError(f"{where}: {error}") from error


@functools.cache
def _type_hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)


def write(value: Any) -> Any:
    """Plain data (dicts, lists, numbers, strings, None) for a dataclass instance: the inverse of `read`."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: write(getattr(value, f.name)) for f in dataclasses.fields(value) if f.init}
    if isinstance(value, Mapping):
        return {str(key): write(entry) for key, entry in value.items()}
    if isinstance(value, tuple | list):
        return [write(entry) for entry in value]
    return value


def _convert(hint: Any, data: Any, where: str) -> Any:
    origin, arguments = get_origin(hint), get_args(hint)
    if hint is Any:
        return data
    if dataclasses.is_dataclass(hint):
        return read(hint, data, where)  # type: ignore[arg-type]
    if origin in (Union, types.UnionType):
        if data is None and type(None) in arguments:
            return None
        return _convert(next(a for a in arguments if a is not type(None)), data, where)
    if origin is Literal:
        if data not in arguments:
            raise SchemaError(f"{where}: {data!r} is not one of {', '.join(map(repr, arguments))}")
        return data
    if origin is tuple:
        if not isinstance(data, list | tuple):
            raise SchemaError(f"{where}: expected a list, found {_describe(data)}")
        if arguments[-1] is not Ellipsis and len(data) != len(arguments):
            raise SchemaError(f"{where}: expected {len(arguments)} entries, found {len(data)}")
        return tuple(_convert(arguments[0], entry, f"{where}[{i}]") for i, entry in enumerate(data))
    if origin in (dict, Mapping):
        if not isinstance(data, Mapping) or not all(isinstance(key, str) for key in data):
            raise SchemaError(f"{where}: expected a table, found {_describe(data)}")
        return {key: _convert(arguments[1], entry, f"{where}.{key}") for key, entry in data.items()}
    return _convert_scalar(hint, data, where)


def _convert_scalar(hint: type, data: Any, where: str) -> Any:
    if hint is float and isinstance(data, int | float) and not isinstance(data, bool):
        if not math.isfinite(data):
            raise SchemaError(f"{where}: must be a finite number, not {data}")
        return float(data)
    if hint is int and isinstance(data, int) and not isinstance(data, bool):
        return data
    if hint in (bool, str) and isinstance(data, hint):
        return data
    raise SchemaError(f"{where}: expected {hint.__name__}, found {_describe(data)}")


def _describe(data: object) -> str:
    text = repr(data)
    return f"{type(data).__name__} {text if len(text) <= 40 else text[:37] + '...'}"
