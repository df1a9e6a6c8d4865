"""Fields of instruments: checked numbers, names and texts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field

from app.shared.parameters import OF_CHOICES
from app.shared.value import Value
from engine.parameters import OF_INSTRUMENTS
from engine.values.drum import DrumParameters
from engine.values.string import StringParameters

LONGEST_NAME = 60  # characters
LONGEST_DESCRIPTION = 400
LONGEST_SCALE = 2**16  # characters of a .scl or .kbm file
FORBIDDEN_IN_NAMES = '/\\:*?"<>|'  # on Linux, macOS or Windows
HIGHEST_KEY = 127


def plain(text: str) -> str:
    """The text without white space around it. Raises ValueError: it is not one printable line."""
    if not text.isprintable():
        raise ValueError("must be one line of printable characters; remove the others")
    return text.strip()


def filled(name: str) -> str:
    """The text as of `plain`. Raises ValueError: it is white space alone, too."""
    name = plain(name)
    if not name:
        raise ValueError("must not be blank; give a name")
    return name


def _safe_name(name: str) -> str:
    """A name that is a valid file name on every system, and no path."""
    name = plain(name)
    if name.startswith(".") or name.endswith(".") or any(c in FORBIDDEN_IN_NAMES for c in name):
        raise ValueError(f"must not begin or end with a full stop, or hold one of {FORBIDDEN_IN_NAMES}; rename it")
    return name


def _lines(text: str) -> str:
    """The text of a Scala file as it is. Raises ValueError: it has control characters."""
    if not all(c.isprintable() or c in "\r\n\t" for c in text):
        raise ValueError("must be the text of a Scala file, without control characters; save it as plain text")
    return text


def ranged(low: float, high: float) -> Any:
    """A field with a range."""
    return Field(ge=low, le=high, strict=True, allow_inf_nan=False)


def parameter(id: str) -> Any:
    """A field with the range and default of a parameter, by its id.

    In files of instruments a number must not be written as text.
    """
    declared = OF_INSTRUMENTS.get(id) or OF_CHOICES[id]
    low, high = declared.limits
    return Field(declared.default, ge=low, le=high, strict=id in OF_INSTRUMENTS, allow_inf_nan=False)


Name = Annotated[str, Field(max_length=LONGEST_NAME), AfterValidator(filled), AfterValidator(_safe_name)]
# the name of something else, "" for none
Reference = Annotated[str, Field(max_length=LONGEST_NAME), AfterValidator(_safe_name)]
Text = Annotated[str, Field(max_length=LONGEST_DESCRIPTION), AfterValidator(plain)]
ScalaText = Annotated[str, Field(max_length=LONGEST_SCALE), AfterValidator(_lines)]
Key = Annotated[int, ranged(0, HIGHEST_KEY)]
Share = Annotated[float, ranged(0, 1)]
Flag = Annotated[bool, Field(strict=True)]


def _check_complete(kind: type, data: Any) -> Any:
    """The data of a string or a drum. Raises ValueError: a parameter is not given whose default is not 0.

    The engine's default is a string or drum of its own, parts of which no other shall have.
    """
    if isinstance(data, Mapping):
        missing = [field.name for field in fields(kind) if field.default != 0 and field.name not in data]
        if missing:
            raise ValueError(f"{', '.join(missing)} must be given; add what is missing")
    return data


String = Annotated[StringParameters, BeforeValidator(partial(_check_complete, StringParameters))]
Drum = Annotated[DrumParameters, BeforeValidator(partial(_check_complete, DrumParameters))]


if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)


class _OfRows(ModelMetaclass):
    """A metaclass that adds a field for each row of a part of the parameter table that the class does not state."""

    def __new__(
        meta, name: str, bases: tuple[type, ...], namespace: dict[str, Any], part: str = "", **options: Any
    ) -> type:
        hints = namespace.setdefault("__annotations__", {})
        for id in OF_INSTRUMENTS:
            section, _, field = id.rpartition(".")
            if part and section == part and field not in hints:
                hints[field], namespace[field] = float, parameter(id)
        return super().__new__(meta, name, bases, namespace, **options)


class Rows(Value, metaclass=_OfRows):
    """A part of an instrument with a field for each row `part.…` of the table of parameters, and its own fields.

    It states those that other code names when it makes one.
    """

    if TYPE_CHECKING:  # the others

        def __getattr__(self, name: str) -> float: ...
