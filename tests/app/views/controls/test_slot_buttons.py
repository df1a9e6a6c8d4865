"""What the buttons of the slots say, with much room and with little."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from app.presets.library import PresetEntry
from app.session.choices import Choices
from app.views.controls.slot_buttons import NARROW_WIDTH, WIDTH, SlotButtons
from engine.presets import read_info


@pytest.fixture
def slots(qtbot: QtBot, small_preset: Path) -> SlotButtons:
    made = SlotButtons()
    qtbot.addWidget(made)
    info = replace(read_info(small_preset), title="Steel E4")
    made.set_entries([PresetEntry("studio_steel_e4", small_preset, info)])
    made.show_choices(Choices(a="preset:studio_steel_e4", b="difference"))
    made.show_gains({"a": -1.2, "b": 20.0})
    return made


def test_a_preset_is_named_by_its_title(slots: SlotButtons) -> None:
    assert slots._buttons["a"].text().startswith("A  Steel E4")
    assert "studio_steel_e4" not in slots._buttons["a"].accessibleName()


def test_a_matched_level_is_reported_with_its_unit(slots: SlotButtons) -> None:
    slots.show_choices(Choices(a="model", b="truth"))
    slots.show_gains({"a": 0.1, "b": -12.3})
    assert [button.text() for button in slots._buttons.values()] == ["A  MODEL  +0.1 dB", "B  TRUTH  -12.3 dB"]


def test_in_the_least_room_model_and_truth_are_whole(slots: SlotButtons) -> None:
    slots.show_choices(Choices(a="model", b="truth"))
    slots.show_gains({})
    slots.set_narrow(True, tight=True)
    assert [button.text() for button in slots._buttons.values()] == ["A  MODEL", "B  TRUTH"]


def test_narrow_the_gain_is_reported_without_its_unit_first(slots: SlotButtons) -> None:
    button = slots._buttons["b"]
    assert (button.width(), button.text()) == (WIDTH, "B  DIFF.  +20 dB")
    slots.set_narrow(True)
    assert button.width() == NARROW_WIDTH
    assert button.text().endswith("+20")
    slots.set_narrow(False)
    assert (button.width(), button.text()) == (WIDTH, "B  DIFF.  +20 dB")
