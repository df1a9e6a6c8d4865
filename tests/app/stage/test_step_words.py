"""Steps of undo in plain words."""

from __future__ import annotations

from typing import Any

import pytest

from app.patches.library import SHIPPED, read_patch
from app.patches.patch import ASSIGNABLE, Patch
from app.shared.parameters import OF_PATCHES
from app.stage.step_words import step_words


@pytest.fixture(scope="module")
def guitar() -> Patch:
    return read_patch(SHIPPED / "classical_guitar.json")


def words(before: Patch, after: Patch) -> str:
    return step_words({"patch": before}, {"patch": after})


def with_part(patch: Patch, **parts: Any) -> Patch:
    return Patch.model_validate({**dict(patch), **parts})


def test_whatever_a_knob_turns_has_words_without_marks(guitar: Patch) -> None:
    for field in ASSIGNABLE:
        if field == "pickup.points.1":
            continue
        value = guitar.value(field)
        for turned in (0.9 * value + 0.011, 0.9 * value - 0.011):
            try:
                reported = words(guitar, guitar.with_value(field, turned))
            except ValueError:
                continue
            assert reported and "_" not in reported and "." not in reported, field
            assert reported == ("listening point" if field.startswith("pickup.") else OF_PATCHES[field].name)


def test_a_macro_is_reported_by_its_name(guitar: Patch) -> None:
    target = {"field": "knobs.decay", "low": 1.0, "high": 3.0}
    patch = with_part(guitar, macros=({"name": "Damp", "value": 0.5, "targets": (target,)},))
    assert words(patch, patch.turned(0, 0.9)) == "Damp"
