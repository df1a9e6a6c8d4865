"""Steps of undo in plain words."""

from __future__ import annotations

from typing import Any

import pytest

from app.patches.library import SHIPPED, read_patch
from app.patches.patch import ASSIGNABLE, BodyChoice, Patch
from app.patches.tuning import TuningChoice
from app.shared.parameters import OF_PATCHES
from app.stage.session import RECORDED
from app.stage.step_words import SEVERAL, step_words


@pytest.fixture(scope="module")
def guitar() -> Patch:
    return read_patch(SHIPPED / "classical_guitar.json")


@pytest.fixture(scope="module")
def harp() -> Patch:
    return read_patch(SHIPPED / "concert_harp.json")


def words(before: Patch, after: Patch) -> str:
    return step_words({"patch": before}, {"patch": after})


def with_part(patch: Patch, **parts: Any) -> Patch:
    return Patch.model_validate({**dict(patch), **parts})


def test_fields_of_a_patch(guitar: Patch, harp: Patch) -> None:
    assert words(guitar, guitar) == ""
    assert words(guitar, harp) == f"instrument {harp.name}"
    string, played = {"patch": guitar, "single": "nylon"}, {"patch": guitar, "single": None}
    assert step_words(string, played) == "instrument Classical guitar"
    assert step_words(played, string) == "preset nylon"
    assert words(guitar, with_part(guitar, name="Mine")) == "name of the instrument"
    assert words(guitar, guitar.with_value("knobs.stiffness", 2.0)) == "stiffness"
    assert words(guitar, guitar.with_value("pluck.position", 0.31)) == "pluck position"
    assert words(guitar, with_part(guitar, body=BodyChoice(name="mine", mix=guitar.body.mix))) == "body"
    scale = "! a\n!\nhalves\n 2\n!\n 600.\n 2/1\n"
    assert words(guitar, with_part(guitar, tuning=TuningChoice(scale=scale))) == "scale"
    assert words(guitar, with_part(guitar, bend_by="length")) == "bend mode"
    assert words(guitar, with_part(guitar, strings=harp.strings)) == "strings"
    two = guitar.with_values({"knobs.stiffness": 2.0, "level_db": -3.0})
    assert words(guitar, two) == "stiffness and level"
    assert words(guitar, two.with_value("knobs.gauge", 2.0)) == SEVERAL


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


def test_choices_of_the_pluck() -> None:
    start = {
        "position": 0.3,
        "amplitude_mm": 2.0,
        "patch": None,
        "single": "a",
        "string": None,
        "width": 0.1,
    }
    assert step_words(start, {**start, "position": 0.5}) == "pluck position"
    assert step_words(start, {**start, "position": 0.5, "amplitude_mm": 4.0}) == "pluck position and amplitude"
    assert step_words(start, {**start, "single": "b"}) == "preset b"
    every = {name: step_words({name: 1}, {name: 2}) for name in RECORDED - {"patch", "single"}}
    assert all(reported and "_" not in reported for reported in every.values()), every
