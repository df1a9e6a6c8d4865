"""The sound of two slots: its voices, levels and gains, and the words in which it is shown."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from app.presets.library import Library, PresetEntry
from app.session.choices import Choices
from app.session.monitor import Monitor
from app.session.shown import readable_unit, shown_sources
from engine.presets import read_info
from tests.app.monitors import hears

MATCH = {"model": 2.0, "truth": 1.0}
B = "preset:b"


@pytest.mark.parametrize(
    ("monitor", "match", "gains"),
    [
        (hears("model"), None, {"model": 1, "truth": 0, B: 0}),
        (hears("truth"), MATCH, {"model": 0, "truth": 1, B: 0}),
        (hears("model", level_match=True), None, {"model": 1, "truth": 0, B: 0}),
        (hears("model", level_match=True), MATCH, {"model": 2, "truth": 0, B: 0}),
        (hears(B, level_match=True), MATCH, {"model": 0, "truth": 0, B: 1}),
        (hears("preset:gone"), None, {"model": 1, "truth": 0, B: 0}),
        (hears("difference", "", True, 20.0), MATCH, {"model": 10, "truth": -10, B: 0}),
        # a note that began without a part of the difference
        (Monitor(a=B, difference=True), None, {B: 1, "truth": 0}),
        (hears("difference"), None, {"model": 1, B: 0}),
    ],
)
def test_one_source_is_heard_or_the_difference(
    monitor: Monitor, match: dict[str, float] | None, gains: dict[str, float]
) -> None:
    assert {source: monitor.gain(source, gains.keys(), match) for source in gains} == pytest.approx(gains)


def test_slots_get_voices_and_gains_are_shown_once_they_are_known() -> None:
    assert Monitor().voices == ("model", "truth")
    assert Monitor(heard="b").voices == ("truth", "model")
    assert Monitor(a="difference", b=B).voices == ("model", "truth", B)
    assert Monitor(a=B, b=B).voices == (B,)
    assert Monitor(level_match=False).gain_db("a", None) == 0
    assert Monitor().gain_db("a", None) is None
    assert Monitor().gain_db("a", MATCH) == pytest.approx(20 * math.log10(2))
    assert Monitor(b="difference", difference_gain_db=12.0).gain_db("b", None) == 12


def test_each_slot_is_reported_with_its_title_and_gain_and_one_source_once(small_preset: Path) -> None:
    info = replace(read_info(small_preset), title="Steel E4, bright")
    library = Library([PresetEntry("steel_e4", small_preset, info)])
    choices = Choices(a="difference", b="preset:steel_e4", heard="b", difference_gain_db=30)
    difference, other = shown_sources(choices, library)
    assert (difference.slots, difference.title, difference.remark) == ("A", "difference", " +30 dB")
    assert difference.gain == pytest.approx(31.6, rel=1e-2)
    assert (other.slots, other.title, other.remark, other.gain) == ("B", "Steel E4, bright", " · heard", 1.0)
    (only,) = shown_sources(Choices(a="truth", b="truth", heard="b"), library)
    assert (only.slots, only.heard) == ("A B", True)


@pytest.mark.parametrize(
    ("peak", "pickup", "factor", "unit"),
    [
        (4e-3, "displacement", 1e3, "mm"),
        (2.0, "displacement", 1e3, "mm"),
        (3e-5, "displacement", 1e6, "µm"),
        (0.0, "displacement", 1e3, "mm"),
        (6.0, "velocity", 1.0, "m/s"),
        (0.02, "bridge", 1e3, "mN"),
        (0.02, "velocity", 1e3, "mm/s"),
        (0.0, "velocity", 1.0, "m/s"),
        (1e-12, "velocity", 1e9, "nm/s"),
    ],
)
def test_a_unit_has_few_digits(peak: float, pickup: str, factor: float, unit: str) -> None:
    assert readable_unit(peak, pickup) == (factor, unit)
