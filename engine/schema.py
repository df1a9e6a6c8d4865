"""The checked reading of plain data (JSON, TOML) into frozen dataclasses, and back.

Every error names the place, the field and the remedy. Types are read from the annotations; supported are
bool, int, float, str, Literal, None unions, tuples of one type, string-keyed mappings and nested dataclasses.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import re
import tomllib
import types
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from engine import bounds
from engine.plain_text import one_line
from engine.read_file import UnusableFile, read_bounded

T = TypeVar("T")
# A dotted key, plain or quoted parts. Possessive: each character is looked at once or twice, whatever the text holds.
_LONG_KEY = re.compile(
    rf"""(?<![\w\\-])(?:(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{bounds.MOST_DOTS + 1}}}"""
)


class SchemaError(ValueError):
    """Data that does not fit its description. The message is one line, whatever the data holds."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


def parse_json(text: str | bytes, where: str, most_bytes: int = bounds.LARGEST_TEXT_BYTES) -> Any:
    """The plain data of a JSON text from anywhere; `where` names it in errors.

    Raises:
        SchemaError: not JSON, longer than it may be, or nested deeper, or with more entries, than `bounds` allows.
    """
    if len(text) > most_bytes:
        raise SchemaError(f"{where}: longer than {most_bytes // 2**10} KiB")
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:  # bad UTF-8 and integers of thousands of digits among them
        raise SchemaError(f"{where}: not JSON that can be read ({error or type(error).__name__})") from error
    check_nesting(data, where)
    return data


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file.

    Raises:
        SchemaError: not TOML, no ordinary file, or larger or nested deeper than `engine.bounds` allows.
        OSError: it cannot be read.
    """
    try:
        text = read_bounded(path, bounds.LARGEST_TOML_BYTES).decode("utf-8")
        if _LONG_KEY.search(text):
            raise SchemaError(f"{path}: a key has more than {bounds.MOST_DOTS} dots")
        data = tomllib.loads(text)
    except UnusableFile as error:
        raise SchemaError(f"{path}: {error.strerror}") from error
    except SchemaError:
        raise
    except (ValueError, RecursionError) as error:  # bad UTF-8 and integers of thousands of digits among them
        raise SchemaError(f"{path}: not valid TOML: {error or type(error).__name__}") from error
    check_nesting(data, str(path))
    return data


def check_nesting(data: object, where: str) -> None:
    """Raises SchemaError where lists and tables lie deeper in each other, or hold more, than anything of ours."""
    level, entries = [data], 0
    for _ in range(bounds.DEEPEST_NESTING):
        level = [
            inner
            for outer in level
            if isinstance(outer, dict | list)
            for inner in (outer.values() if isinstance(outer, dict) else outer)
        ]
        if not level:
            return
        entries += len(level)
        if entries > bounds.MOST_JSON_ENTRIES:
            raise SchemaError(f"{where}: more than {bounds.MOST_JSON_ENTRIES} entries")
    raise SchemaError(f"{where}: nested more than {bounds.DEEPEST_NESTING} deep")


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
    except OverflowError as error:
        raise SchemaError(f"{where}: a number is too large ({error})") from error


def without_retired(data: object, retired: Mapping[str, Any], where: str) -> Any:
    """Plain data without the fields of earlier versions, which are given with the only value that they ever had.

    Raises:
        SchemaError: one has another value; the message names it.
    """
    if not isinstance(data, Mapping):
        return data
    for name in retired.keys() & data.keys():
        if write(data[name]) != retired[name]:
            raise SchemaError(f"{where}.{name}: {bounds.brief(data[name])} is of an earlier version; train it again")
    return {name: value for name, value in data.items() if name not in retired}


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
            raise SchemaError(f"{where}: {bounds.brief(data)} is not one of {', '.join(map(repr, arguments))}")
        return data
    if origin is tuple:
        if not isinstance(data, list | tuple):
            raise SchemaError(f"{where}: expected a list, found {_describe(data)}")
        if len(data) > bounds.MOST_ENTRIES:
            raise SchemaError(f"{where}: has {len(data)} entries, at most {bounds.MOST_ENTRIES} may be given")
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
        try:
            value = float(data)
        except OverflowError:
            value = math.inf
        if not math.isfinite(value):
            raise SchemaError(f"{where}: must be a finite number, not {bounds.brief(data)}")
        return value
    if hint is int and isinstance(data, int) and not isinstance(data, bool):
        if abs(data) > bounds.LARGEST_INTEGER:
            raise SchemaError(f"{where}: must be a number of at most 64 bits, not {bounds.brief(data)}")
        return data
    if hint is bool and isinstance(data, bool):
        return data
    if hint is str and isinstance(data, str):
        if len(data) > bounds.LONGEST_STRING:
            raise SchemaError(f"{where}: has {len(data)} characters, at most {bounds.LONGEST_STRING} may be given")
        return data
    raise SchemaError(f"{where}: expected {hint.__name__}, found {_describe(data)}")


def _describe(data: object) -> str:
    return f"{type(data).__name__} {bounds.brief(data)}"
