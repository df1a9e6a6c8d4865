"""What a preset's card and its line say of the errors, of both splits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from PySide6.QtWidgets import QApplication

from app.presets.library import PresetEntry
from app.views.dialogs.preset_card import preset_card, preset_summary
from engine.presets import read_info


def test_the_test_split_stands_beside_validation(qapp: QApplication, small_preset: Path) -> None:
    info = read_info(small_preset)
    tested = PresetEntry("tested", small_preset, replace(info, rel_mae=0.0012, test_rel_mae=0.0034))
    assert "0.12 % of the motion in validation, on the test set 0.34 %" in preset_card(tested)
    assert all(line.endswith("validation error 0.12 %, test 0.34 %") for line in preset_summary(tested))
    untested = PresetEntry("untested", small_preset, info)
    assert "test set" not in preset_card(untested)
    assert all(line.endswith("validation error 25 %") for line in preset_summary(untested))
