"""The pluck as trained: within the training of every shipped preset that knows one, and when a choice brings it."""

from __future__ import annotations

from dataclasses import asdict

import pytest

from app.presets.library import Library, list_presets
from app.presets.words import why_no_middle
from app.session.choices import Choices
from app.session.trained import brought_pluck
from engine.pluck import Pluck
from engine.presets import SHIPPED, outside_training

LIBRARY = Library(list_presets(SHIPPED)[0])
LRU, FGRU = "nylon_nonlinear_gaussian_16k_lru_400", "nylon_nonlinear_gaussian_16k_fgru_400"
LINEAR, NOISE, STUDIO = "nylon_linear_gaussian_16k_lru", "nylon_nonlinear_noise_4k_koopman", "studio_nylon_b3"


def test_every_middle_lies_within_its_training_and_the_others_say_why_there_is_none() -> None:
    for entry in LIBRARY.entries:
        info = entry.info
        if info.initial == "noise" or info.family is not None:
            assert info.middle_pluck is None and why_no_middle(info).startswith("It was trained on"), entry.name
        else:
            assert info.middle_pluck is not None and why_no_middle(info) == "", entry.name
            assert outside_training(info, info.middle_pluck) == [], entry.name
    middles = [entry.info.middle_pluck for entry in LIBRARY.entries if entry.name in (LRU, STUDIO)]
    assert middles == [Pluck(0.5, 2.236, "gaussian", 0.0949), Pluck(0.5, 5.5, "gaussian", 0.06)]


@pytest.mark.parametrize(
    ("before", "shape", "chosen", "brings"),
    [
        ("studio_any_string", "rounded", LRU, True),
        ("studio_any_string", "gaussian", LRU, False),  # within its training already
        (LRU, "rounded", FGRU, False),  # of one training: both play what the user has chosen
        (LRU, "rounded", LINEAR, True),  # another string
        (NOISE, "rounded", LRU, True),  # other plucks
        (LRU, "rounded", NOISE, False),  # none is known
        (LRU, "rounded", "gone", False),
    ],
)
def test_a_preset_brings_its_pluck_where_the_present_one_is_outside_and_the_training_is_another(
    before: str, shape: str, chosen: str, brings: bool
) -> None:
    found = brought_pluck(Choices(single=before, shape=shape), LIBRARY, chosen)
    entry = LIBRARY.find(chosen)
    assert found == (asdict(entry.info.middle_pluck) if brings and entry and entry.info.middle_pluck else {})
