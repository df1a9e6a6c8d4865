"""The two faces of the window, Play and Lab, and the areas that each of them shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, get_args

from app.shared.vocabulary import Face

Area = Literal[
    "preset",  # header: the preset's name, previous and next
    "test",  # header: listening test, keys, rate
    "facts",  # below the header: facts of the preset, what lies outside the training, the error
    "views",  # the decks of plots
    "slots",  # A and B
    "pluck",  # shape, position, amplitude and width of the drawn pluck
    "time",  # duration and slow motion
    "instrument",  # the instrument's bar, the knobs of its string and of techniques
    "growth",  # header: a sign where the error grew
]  # the string, its listening point, the keys and the output are in both

# face -> its areas
FACES: Mapping[Face, frozenset[Area]] = {
    "play": frozenset({"instrument", "growth"}),
    "lab": frozenset(get_args(Area)) - {"instrument", "growth"},
}
TITLES: tuple[tuple[Face, str, str], ...] = (
    ("play", "Play", "Play the instrument (F9)"),
    ("lab", "Lab", "Compare the model with the truth: slots, plots, errors, listening test (F9)"),
)
