"""What the hosts of these tests share: C structures as the formats' documents have them, and pieces in blocks."""

import ctypes as c
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
FIELD = re.compile(r"\s*(\w+)(?:\[(\d+)\]|\(([\w, ]*)\))?\s+(\w+)\s*")
Sound = NDArray[np.float32]
Events = Sequence[tuple[int, Any]]  # at a frame, three bytes of MIDI or what a format has beside it


def function(result: str, *arguments: str) -> Any:
    """A pointer to a function of these kinds."""
    return c.CFUNCTYPE(KINDS[result], *(KINDS[each] for each in arguments))


def structures(format: str) -> SimpleNamespace:
    """A format's structures, `name { … }` of fields `kind name`, `kind[length] name`, `result(arguments) name`."""
    made: dict[str, Any] = {}
    declarations = Path(__file__).with_name(f"{format}.txt").read_text("utf-8")
    for union, structure, fields in re.findall(r"(union )?(\w+) \{(.*?)\}", declarations, re.DOTALL):
        kinds: dict[str, Any] = {}
        for each in fields.split(";"):
            kind, length, arguments, name = FIELD.fullmatch(each).groups()  # type: ignore[union-attr]
            one = {**KINDS, **made}[kind]
            if arguments is not None:
                one = function(kind, *filter(None, arguments.split(", ")))
            kinds[name] = one * int(length) if length else one
        base = c.Union if union else c.Structure
        made[structure] = type(structure, (base,), {"_fields_": list(kinds.items()), "kinds": kinds})
    return SimpleNamespace(**made)


def filled(kind: Any, **values: Callable[..., Any] | object) -> Any:
    """A structure with these values; Python functions become its own."""
    made = kind()
    for name, value in values.items():
        function = callable(value) and not isinstance(value, c.Structure)
        setattr(made, name, kind.kinds[name](value) if function else value)
    return made


def cut_off(left: list[bytes], size: int) -> bytes:
    """The next bytes of a state that is read: few at a time, as hosts may give them."""
    part, left[0] = left[0][: min(size, 7)], left[0][min(size, 7) :]
    return part


class Playing:
    """An instance of a format: `block` gives the next frames, (frames, 2), with events at frames of its own."""

    frame = 0
    block: Callable[[int, Events], Sound]

    def render(self, frames: int, events: Events, block: int = 512) -> Sound:
        """A piece, (frames, 2), in blocks; frames of events count from its beginning, which is now."""
        first, parts = self.frame, []
        ordered = sorted(((first + at, what) for at, what in events), key=lambda event: event[0])
        while self.frame < first + frames:
            begin, count = self.frame, min(block, first + frames - self.frame)
            parts.append(self.block(count, [(at - begin, what) for at, what in ordered if 0 <= at - begin < count]))
        return np.concatenate(parts)
