"""What of the slots is shown, and in which words."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from app.presets.library import Library, PresetEntry
from app.session.choices import Choices
from app.session.shown import readable_unit, shown_sources
from engine.presets import read_info


@pytest.fixture
def library(small_preset: Path) -> Library:
    info = replace(read_info(small_preset), title="Steel E4, bright")
    return Library([PresetEntry("steel_e4", small_preset, info)])


def test_each_slot_is_reported_with_its_title_and_gain(library: Library) -> None:
    choices = Choices(a="difference", b="preset:steel_e4", heard="b", difference_gain_db=30)
    difference, other = shown_sources(choices, library)
    assert (difference.slots, difference.title, difference.remark) == ("A", "difference", " +30 dB")
    assert difference.gain == pytest.approx(31.6, rel=1e-2)
    assert (other.slots, other.title, other.remark, other.gain) == ("B", "Steel E4, bright", " · heard", 1.0)


def test_what_both_slots_hold_is_shown_once(library: Library) -> None:
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
