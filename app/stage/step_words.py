"""The change by a step of undo, in words: fields of pluck or instrument, or another instrument."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from app.instruments.instrument import Instrument
from app.shared.parameters import OF_CHOICES
from app.shared.value import Value
from engine.parameters import OF_INSTRUMENTS

MOST_NAMED = 2  # fields in one step's name
SEVERAL = "several settings"
CHOICES = {  # fields of `Choices`
    **{name: OF_CHOICES[name].name for name in ("position", "amplitude_mm", "width", "seconds")},
    "shape": "pluck shape",
    "string": "string",
}
INSTRUMENT = {  # fields that are no parameters, by their path; the rest are named by the last part of theirs
    "name": "name of the instrument",
    "preset": "model",
    "range": "range of keys",
    "pluck.shape": "pluck shape",
    "pickup.points": "stereo",
    "pickup.kind": "pick-up",
    "mode": "playing mode",
    "bend_by": "bend mode",
    "mod_wheel": "modulation wheel",
    "tuning.keymap": "keyboard mapping",
    "body.name": "body",
}


def step_words(before: Mapping[str, Any], after: Mapping[str, Any]) -> str:
    """Name what changed; "" where nothing did.

    Args:
        before, after: the same fields of `Choices` with their values before and after the step.
    """
    changed = [name for name in after if before[name] != after[name]]
    if "single" in changed:
        preset = after["single"]
        return f"preset {preset}" if preset is not None else _instrument_words(None, after["instrument"])
    if "instrument" in changed:
        return _instrument_words(before["instrument"], after["instrument"])
    pickups = [values["string_pickup"] for values in (before, after) if "string_pickup" in changed]
    heard = [field_words(f"pickup.{path}") for path in _changed(*pickups)] if pickups else []
    if changed == ["right"]:  # which is not heard yet
        heard = [OF_CHOICES["listen_right"].name]
    return _join_words([*(words for name, words in CHOICES.items() if name in changed), *heard])


def turned_fields(before: Mapping[str, Any], after: Mapping[str, Any]) -> frozenset[str]:
    """The fields of a step, and "FIELD.PATH" of what changed in a pick-up or an instrument that has kept its name."""
    names = set(after)
    for name in ("instrument", "string_pickup"):
        old, new = before.get(name), after.get(name)
        if old is not None and new is not None and getattr(old, "name", "") == getattr(new, "name", ""):
            names |= {f"{name}.{path}" for path in _changed(old, new)}
    return frozenset(names)


def _instrument_words(before: Instrument | None, after: Instrument | None) -> str:
    """Name the change from one instrument to another; None: there is none."""
    if after is None:
        return "no instrument"
    if before is None:
        return f"instrument {after.name}"
    paths = list(_changed(before, after))
    if "name" in paths and len(paths) > 1:
        return f"instrument {after.name}"
    if "macros" in paths:
        macro_names = [new.name for old, new in zip(before.macros, after.macros, strict=False) if old != new]
        return _join_words(macro_names or ["macros"])
    return _join_words([field_words(field) for field in paths])


def field_words(field: str) -> str:
    """The words for an instrument's field, by its path, as "pluck.shape"."""
    if field in OF_INSTRUMENTS:
        return OF_INSTRUMENTS[field].name
    return INSTRUMENT.get(field, field.rpartition(".")[2].replace("_", " "))


def _changed(before: object, after: object, path: str = "") -> Iterator[str]:
    """The dotted paths of fields that differ, beginning with `path`.

    A part that has fields itself is compared by these, except strings.
    """
    for name in _names(after):
        old, new = getattr(before, name), getattr(after, name)
        if old == new:
            continue
        if _names(new) and type(old) is type(new) and name != "strings":
            yield from _changed(old, new, f"{path}{name}.")
        elif name == "points" and len(old) == len(new):
            yield from (f"{path}{name}.{number}" for number in range(len(new)) if old[number] != new[number])
        else:
            yield f"{path}{name}"


def _names(part: object) -> Collection[str]:
    """The names of the fields of a part of an instrument; none where it has no parts."""
    if isinstance(part, Value):
        return type(part).model_fields
    return [part_field.name for part_field in fields(part)] if is_dataclass(part) else ()


def _join_words(words: list[str]) -> str:
    """Join names by "and", each once; SEVERAL where there are more than MOST_NAMED."""
    words = list(dict.fromkeys(words))
    return SEVERAL if len(words) > MOST_NAMED else " and ".join(words)
