"""What lies outside the training is reported of the string as the knobs have it."""

from __future__ import annotations

from app.instrument.beyond_training import outside_of_key
from app.instrument.events import NoteOn
from app.patches.patch import Knobs, Patch
from engine.presets import Preset


def test_a_key_is_judged_with_the_knobs_of_the_patch(patch: Patch, preset: Preset) -> None:
    def decays_reported(patch: Patch) -> list[str]:
        return [
            words for words in outside_of_key(preset.info, patch, NoteOn(57, 60)) if words.startswith("decay time")
        ]

    assert (
        len(decays_reported(patch)) == 1
    )  # near 3 kHz; that of the first mode, with which no error grows, is not named
    assert decays_reported(patch.model_copy(update={"knobs": Knobs(decay=20.0, brightness_decay=20.0)})) == []


def test_a_key_without_a_string_has_nothing_to_be_reported(patch: Patch, preset: Preset) -> None:
    assert outside_of_key(preset.info, patch.model_copy(update={"range": (60, 72)}), NoteOn(40, 60)) == []
