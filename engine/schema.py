"""The checked reading of plain data (JSON, TOML) into frozen dataclasses, and back.

Pydantic reads the types from the annotations. Here are the bounds on what any file may hold, and errors in one line:
place, field and the value found.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

from pydantic import TypeAdapter, ValidationError

from engine import bounds
from engine.plain_text import LineError
from engine.whole_file import UnusableFile, read_bounded

T = TypeVar("T")
# A dotted key, plain or quoted parts. Possessive: each character is looked at once or twice, whatever the text holds.
_LONG_KEY = re.compile(
    rf"""(?<![\w\\-])(?:(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{bounds.MOST_DOTS + 1}}}"""
)


_adapter: Callable[[Any], TypeAdapter[Any]] = functools.cache(TypeAdapter)


class SchemaError(LineError, ValueError):
    """Data that does not fit its description. The message is one line, whatever the data holds."""


def parse_json(text: str | bytes, where: str, most_bytes: int = bounds.LARGEST_TEXT_BYTES) -> Any:
    """The plain data of a JSON text from anywhere; `where` names it in errors.

    Raises:
        SchemaError: not JSON, longer than it may be, or nested deeper, or with more entries, than `bounds` allows.
    """
    if len(text) > most_bytes:
        raise SchemaError(f"{where}: longer than {most_bytes // 2**10} KiB")
    try:
        data = json.loads(text, object_pairs_hook=_table)
    except (ValueError, RecursionError) as error:  # bad UTF-8 and integers of thousands of digits among them
        raise SchemaError(f"{where}: not JSON that can be read ({error or type(error).__name__})") from error
    check_nesting(data, where)
    return data


def _table(fields: list[tuple[str, Any]]) -> dict[str, Any]:
    """The fields of a JSON object, of which none may be given twice: one of the two would be lost."""
    pairs: dict[str, Any] = {}
    for name, value in fields:
        if name in pairs:
            raise ValueError(f"field {bounds.brief(name)} is given twice")
        pairs[name] = value
    return pairs


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file.

    Raises:
        SchemaError: not TOML, no ordinary file, or larger or nested deeper than `engine.bounds` allows.
        OSError: it cannot be read.
    """
    try:
        text = read_bounded(path, bounds.LARGEST_TOML_BYTES).decode("utf-8-sig")
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


def _text_of(data: Any) -> str:
    """Return JSON of plain data that pydantic reads.

    Half characters, of names of files that are no text, become U+FFFD.
    """
    text = json.dumps(data, ensure_ascii=False)
    return text.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "replace")


def check_nesting(data: object, where: str) -> None:
    """Raise SchemaError where lists and tables lie deeper in each other, or hold more, than anything of ours."""
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
        raise SchemaError(f"{where}: must be a table of fields, found {_describe(data)}")
    _check_bounds(data, where)
    try:  # as JSON: in Python's own data a strict reader takes no list for a tuple
        checked: T = _adapter(kind).validate_json(_text_of(data), strict=True, extra="forbid")
        return checked
    except ValidationError as error:
        raise SchemaError(explained(error, where, kind)) from error
    except (TypeError, OverflowError) as error:
        raise SchemaError(f"{where}: {error}") from error


def explained(error: ValueError, where: str = "", kind: object = None) -> str:
    """The first fault of data that were refused: its place, what is wrong there, and what was found.

    Args:
        where: the name of the data.
        kind: the dataclass that they were read into; of an unknown field, those that it knows are listed.
    """
    if not isinstance(error, ValidationError):
        return str(error)
    first, *others = error.errors(include_url=False)
    if first["type"] == "missing":  # maybe because it is misspelled
        first = next((problem for problem in others if problem["type"] in _UNKNOWN), first)
    path, value = list(first["loc"]), first["input"]
    if first["type"] == "missing":
        words = f"field {path.pop()!r} is missing"
    elif first["type"] in _UNKNOWN:
        words = f"unknown field {bounds.brief(path.pop())}"
        words += f"; known are {', '.join(_names(kind, path))}" if kind else ""
    elif first["type"] == "value_error":
        words = str(first["ctx"]["error"])
    elif first["type"] == "union_tag_not_found":
        words = f"field {first['ctx']['discriminator']} is missing"
    elif first["type"] == "union_tag_invalid":
        path.append(first["ctx"]["discriminator"].strip("'"))
        words = f"must be one of {first['ctx']['expected_tags']}, found {bounds.brief(first['ctx']['tag'])}"
    else:
        shown = f", found {bounds.brief(value)}" if isinstance(value, str | float | int | None) else ""
        words = _PLAIN.get(first["type"]) or re.sub(r"^\w+ should ", "must ", first["msg"])
        words = words.replace(" after validation", "") + shown
    place = where + _place(path) if where else _place(path).removeprefix(".")
    return f"{place}: {words}" if place else words


def _place(path: Iterable[str | int]) -> str:
    """A path of fields and of numbers of entries as in ".block[0].name"."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part[:100]}" for part in path)


_UNKNOWN = ("unexpected_keyword_argument", "extra_forbidden")
_TABLES, _LISTS = ("dict_type", "model_type", "model_attributes_type", "dataclass_type"), ("list_type", "tuple_type")
_PLAIN = dict.fromkeys(_TABLES, "must be a table of fields") | dict.fromkeys(_LISTS, "must be a list")
_PLAIN["bool_type"] = "must be true or false"


def _names(kind: Any, path: Iterable[str | int]) -> list[str]:
    """The names of the fields of the dataclass at a path in another."""
    for part in path:
        inner = get_type_hints(kind)[part] if isinstance(part, str) else kind
        kind = next(
            (candidate for candidate in (inner, *get_args(inner)) if dataclasses.is_dataclass(candidate)), inner
        )
    return [field.name for field in dataclasses.fields(kind)]


def _check_bounds(data: object, where: str) -> None:
    """Raise SchemaError for what no field holds: a long list or text, a number that is not finite, a date."""
    if isinstance(data, Mapping | list | tuple):
        if not isinstance(data, Mapping) and len(data) > bounds.MOST_ENTRIES:
            raise SchemaError(f"{where}: has {len(data)} entries, at most {bounds.MOST_ENTRIES} may be given")
        for key, entry in data.items() if isinstance(data, Mapping) else enumerate(data):
            _check_bounds(entry, f"{where}{_place([key])}")
    elif isinstance(data, str) and len(data) > bounds.LONGEST_STRING:
        raise SchemaError(f"{where}: has {len(data)} characters, at most {bounds.LONGEST_STRING} may be given")
    elif isinstance(data, float) and not math.isfinite(data):
        raise SchemaError(f"{where}: must be a finite number, not {data}")
    elif isinstance(data, int) and abs(data) > bounds.LARGEST_INTEGER:
        raise SchemaError(f"{where}: must be a number of at most 64 bits, not {bounds.brief(data)}")
    elif not isinstance(data, str | float | int | None):
        raise SchemaError(f"{where}: must be a number or a text, found {_describe(data)}")


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


def write(value: Any) -> Any:
    """Plain data (dicts, lists, numbers, strings, None) for a dataclass instance: the inverse of `read`."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: write(getattr(value, f.name)) for f in dataclasses.fields(value) if f.init}
    if isinstance(value, Mapping):
        return {str(key): write(entry) for key, entry in value.items()}
    if isinstance(value, tuple | list):
        return [write(entry) for entry in value]
    return value


def _describe(data: object) -> str:
    """The type of a value and the value, in a few words."""
    return f"{type(data).__name__} {bounds.brief(data)}"
