"""The pluck that a preset brings when it is chosen: the middle of what it was trained on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from app.presets.library import Library
from app.session.choices import Choices
from engine.presets import PresetInfo, outside_training


def brought_pluck(choices: Choices, library: Library, name: str) -> Mapping[str, Any]:
    """The fields of `Choices` that change with the preset that is chosen.

    It brings its trained pluck, unless the present one lies within its training. After a preset with the same
    training nothing changes: models of one training are compared on one pluck, whichever it is.
    """
    entry, before = library.find(name), library.find(choices.single or "")
    pluck = None if entry is None else entry.info.middle_pluck
    if entry is None or pluck is None or not outside_training(entry.info, choices.pluck):
        return {}
    if before is not None and _training(before.info) == _training(entry.info):
        return {}
    return {"pluck": pluck}


def _training(info: PresetInfo) -> tuple[object, ...]:
    """A value that is equal for presets of the same training."""
    return info.string, info.tension_modulated, info.initial, info.trained_range
