"""Silence is explained."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.presets.library import Library, list_presets
from app.rendering import Take
from app.session.choices import Choices
from app.session.silence import why_difference_silent, why_ran_away, why_silent
from engine.pluck import Pluck
from engine.presets import find_string, read_info
from engine.presets.finding import SHIPPED
from engine.presets.of_string import read_string
from engine.values.ear import Ear
from tests.app.takes import append_to

STRINGS = {name: read_string(find_string(name)) for name in ("nylon_e2", "piano_c4")}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, ""),
        ({"amplitude_mm": 0}, "amplitude is 0"),
        ({"volume_db": -60}, "volume"),
        ({"listen": 0.0}, "listening point is at a fixed end"),
        ({"listen": 0.0, "stereo": True}, "left silent"),
        ({"listen_right": 1.0}, ""),
        ({"listen_right": 1.0, "stereo": True}, "right silent"),
        ({"listen": 0.0, "listen_right": 1.0, "stereo": True}, "both listening points are at a fixed end"),
        ({"solo": 2}, ""),
        ({"solo": 2, "listen": 0.5}, "a node of mode 2"),
        ({"solo": 11}, "this string has 10"),
        ({"solo": 2, "position": 0.5}, "does not excite mode 2"),
        ({"a": "preset:gone"}, "gone was not found"),
        ({"b": "preset:gone"}, ""),
        # modes are those of the string that is plucked, not of the one that a preset of many was measured with
        ({"single": "studio_any_string", "string": STRINGS["nylon_e2"], "solo": 60, "position": 0.113}, ""),
        ({"single": "studio_any_string", "string": STRINGS["piano_c4"], "solo": 55}, "this string has 53"),
    ],
)
def test_the_reason_is_named(small_preset: Path, changes: dict[str, object], words: str) -> None:
    library = Library([*list_presets(small_preset.parent)[0], *list_presets(SHIPPED)[0]])
    found = why_silent(Choices(**{"single": "small", **changes}), library)
    assert words in found
    assert bool(found) == bool(words)


def test_a_difference_of_nothing_or_too_little_is_named(
    small_preset: Path, hear: Callable[[Take, Ear], None]
) -> None:
    choices = Choices()
    take = Take("small", read_info(small_preset), Pluck(), 0.5, choices.ear)
    rest = np.zeros((take.frames, take.info.grid_points), np.float32)
    assert why_difference_silent(choices, take) == ""  # nothing is known yet
    append_to(take, rest, rest)
    hear(take, choices.ear)
    assert "are identical" in why_difference_silent(choices, take)
    assert why_difference_silent(choices.model_copy(update={"listen": 0.2}), take) == ""  # of there nothing is known
    for off_m, gain_db, words in ((1e-7, 20, "raise its gain"), (1e-7, 60, ""), (1e-3, 0, "")):
        take = Take("small", take.info, Pluck(), 0.5, choices.ear)
        append_to(take, rest + np.float32(off_m), rest)
        hear(take, choices.ear)
        found = why_difference_silent(Choices(difference_gain_db=gain_db), take)
        assert words in found
        assert bool(found) == bool(words)


def test_a_model_that_runs_away_is_reported_with_the_reason(small_preset: Path) -> None:
    take = Take("small", read_info(small_preset), Pluck(amplitude_mm=20.0), 0.5, Ear((0.5,)))
    assert why_ran_away(take) == ""
    take.model_ends_s = 0.0
    at_once = why_ran_away(take)
    assert take.info.title in at_once
    assert "cannot play this pluck" in at_once
    assert "amplitude 20 mm is outside" in at_once
    take.model_ends_s = 0.25
    assert "0.25 s after the pluck" in why_ran_away(take)
