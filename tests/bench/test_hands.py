"""Simulated playing: which of the computer's keys play an instrument."""

from __future__ import annotations

import pytest

from app.patches.instrument import SingleString
from app.patches.library import SHIPPED, read_patch
from app.playing.keyboard import PLACES, KeyPress, place_of
from tests.bench.play.hands import KEYS, keys_of, octave_of


@pytest.mark.parametrize(
    ("name", "octave", "keys"),
    [("concert_toms", -1, 16), ("thin_bars", 1, 17), ("tuned_toms", 0, 13), ("concert_harp", 0, 17)],
)
def test_the_octave_is_that_in_which_most_keys_sound(name: str, octave: int, keys: int) -> None:
    patch = read_patch(SHIPPED / f"{name}.json")
    assert octave_of(patch) == octave
    assert keys_of(patch) == KEYS[:keys]


def test_the_keys_of_a_single_string_are_its_places_in_order() -> None:
    letters = [";" if key == "semicolon" else key for key in keys_of(SingleString(preset="studio_nylon_b3"))]
    assert [place_of(KeyPress(letter)) for letter in letters] == list(range(PLACES))
    assert octave_of(SingleString(preset="studio_nylon_b3")) == 0
