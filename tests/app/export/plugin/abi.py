"""C structures from their declarations, for the hosts of these tests: as the formats' documents have them."""

from __future__ import annotations

import ctypes as c
import re
from collections.abc import Callable
from typing import Any

P = c.c_void_p
KINDS: dict[str, Any] = {
    "void": None,
    "bool": c.c_bool,
    "char": c.c_char,
    "f32": c.c_float,
    "f64": c.c_double,
    "ptr": P,
    "size": c.c_size_t,
    "str": c.c_char_p,
    **{f"{sign}{bits}": getattr(c, f"c_{name}{bits}") for sign, name in zip("iu", ("int", "uint"), strict=True)
       for bits in (8, 16, 32, 64)},
}  # fmt: skip
FIELD = re.compile(r"(\w+)(?:\[(\d+)\]|\(([\w, ]*)\))?\s+(\w+)")


def function(result: str, *arguments: str) -> Any:
    """A pointer to a function of these kinds."""
    return c.CFUNCTYPE(KINDS[result], *(KINDS[each] for each in arguments))


def structure(declaration: str, **others: Any) -> Any:
    """A structure of fields `kind name`, `kind[length] name` and `result(arguments) name`, with ; between them."""
    kinds: dict[str, Any] = {}
    for each in declaration.split(";"):
        found = FIELD.fullmatch(each.strip())
        assert found, each
        kind, length, arguments, name = found.groups()
        if arguments is not None:
            kinds[name] = function(kind, *filter(None, arguments.split(", ")))
        else:
            one = others.get(kind) or KINDS[kind]
            kinds[name] = one * int(length) if length else one
    return type("Declared", (c.Structure,), {"_fields_": list(kinds.items()), "kinds": kinds})


def filled(kind: Any, **values: Callable[..., Any] | object) -> Any:
    """A structure with these values; Python functions become its own."""
    made = kind()
    for name, value in values.items():
        function = callable(value) and not isinstance(value, c.Structure)
        setattr(made, name, kind.kinds[name](value) if function else value)
    return made
