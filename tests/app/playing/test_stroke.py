"""What is plucked and how it is mixed."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from app.playing.stroke import Mix, Stroke
from engine.pluck import Pluck
from engine.voices import Ear

STROKE = Stroke(Path("a"), Pluck(), Ear((0.4,)), 2.0, ("model", "truth", "preset:b"), {"preset:b": Path("b")})
MATCH = {"model": 2.0, "truth": 1.0}


def test_a_source_belongs_to_its_preset() -> None:
    assert [STROKE.subject(source) for source in STROKE.sources] == [Path("a"), Path("a"), Path("b")]


@pytest.mark.parametrize(
    ("changes", "same"),
    [
        ({"seconds": 5.0}, True),
        ({"pluck": Pluck(0.5)}, False),
        ({"preset": Path("c")}, False),
        ({"ear": Ear((0.4,), "velocity")}, False),
        ({"sources": ("model", "truth")}, False),
        ({"others": {"preset:b": Path("elsewhere/b")}}, False),
    ],
)
def test_levels_depend_on_all_that_is_heard(changes: dict[str, object], same: bool) -> None:
    assert (replace(STROKE, **changes).matching_key == STROKE.matching_key) == same  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("mix", "match", "gains"),
    [
        (Mix("model"), None, {"model": 1.0, "truth": 0.0, "preset:b": 0.0}),
        (Mix("truth"), MATCH, {"model": 0.0, "truth": 1.0, "preset:b": 0.0}),
        (Mix("model", matched=True), None, {"model": 1.0, "truth": 0.0, "preset:b": 0.0}),
        (Mix("model", matched=True), MATCH, {"model": 2.0, "truth": 0.0, "preset:b": 0.0}),
        (Mix("preset:b", matched=True), MATCH, {"model": 0.0, "truth": 0.0, "preset:b": 1.0}),
        (Mix("difference", True, 20.0), MATCH, {"model": 10.0, "truth": -10.0, "preset:b": 0.0}),
    ],
)
def test_one_source_is_heard_or_the_difference(
    mix: Mix, match: dict[str, float] | None, gains: dict[str, float]
) -> None:
    assert {source: mix.gain(source, match) for source in gains} == pytest.approx(gains)


def test_gains_are_told_once_they_are_known() -> None:
    assert Mix().gain_db("model", None) == 0
    assert Mix(matched=True).gain_db("model", None) is None
    assert Mix(matched=True).gain_db("model", MATCH) == pytest.approx(20 * math.log10(2))
    assert Mix(matched=True, difference_gain_db=12.0).gain_db("difference", None) == 12
