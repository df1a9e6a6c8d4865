"""The sound of two slots, and its level."""

from __future__ import annotations

import math

import pytest

from app.session.monitor import Monitor
from tests.app.monitors import hears

MATCH = {"model": 2.0, "truth": 1.0}


@pytest.mark.parametrize(
    ("monitor", "match", "gains"),
    [
        (hears("model"), None, {"model": 1.0, "truth": 0.0, "preset:b": 0.0}),
        (hears("truth"), MATCH, {"model": 0.0, "truth": 1.0, "preset:b": 0.0}),
        (hears("model", level_match=True), None, {"model": 1.0, "truth": 0.0, "preset:b": 0.0}),
        (hears("model", level_match=True), MATCH, {"model": 2.0, "truth": 0.0, "preset:b": 0.0}),
        (hears("preset:b", level_match=True), MATCH, {"model": 0.0, "truth": 0.0, "preset:b": 1.0}),
        (hears("preset:gone"), None, {"model": 1.0, "truth": 0.0, "preset:b": 0.0}),
        (
            hears("difference", level_match=True, difference_gain_db=20.0),
            MATCH,
            {"model": 10.0, "truth": -10.0, "preset:b": 0.0},
        ),
        # a note that began without a part of the difference
        (Monitor(a="preset:b", difference=True), None, {"preset:b": 1.0, "truth": 0.0}),
        (hears("difference"), None, {"model": 1.0, "preset:b": 0.0}),
    ],
)
def test_one_source_is_heard_or_the_difference(
    monitor: Monitor, match: dict[str, float] | None, gains: dict[str, float]
) -> None:
    assert {source: monitor.gain(source, gains.keys(), match) for source in gains} == pytest.approx(gains)


@pytest.mark.parametrize(
    ("monitor", "voices"),
    [
        (Monitor(), ("model", "truth")),
        (Monitor(heard="b"), ("truth", "model")),
        (Monitor(a="difference", b="preset:b"), ("model", "truth", "preset:b")),
        (Monitor(a="preset:b", b="preset:b"), ("preset:b",)),
    ],
)
def test_what_slots_hold_gets_voices(monitor: Monitor, voices: tuple[str, ...]) -> None:
    assert monitor.voices == voices


def test_gains_are_shown_once_they_are_known() -> None:
    assert Monitor(level_match=False).gain_db("a", None) == 0
    assert Monitor().gain_db("a", None) is None
    assert Monitor().gain_db("a", MATCH) == pytest.approx(20 * math.log10(2))
    assert Monitor(b="difference", difference_gain_db=12.0).gain_db("b", None) == 12
