"""What a note is of."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from app.playing.note import Note
from app.rendering import RenderRequest
from engine.pluck import Pluck
from engine.values.ear import Ear

SOURCES = ("model", "truth", "preset:b")
PLUCK = RenderRequest(Path("a"), Pluck(), 2.0, Ear((0.4,)), others=(Path("b.safetensors"),))


def test_a_source_belongs_to_its_preset() -> None:
    note = Note(PLUCK, SOURCES)
    assert [note.subject(source) for source in SOURCES] == [Path("a"), Path("a"), Path("b.safetensors")]


@pytest.mark.parametrize(
    ("changes", "same"),
    [
        ({"seconds": 5.0}, True),
        ({"speed": 0.5}, True),
        ({"pluck": Pluck(0.5)}, False),
        ({"preset": Path("c")}, False),
        ({"ear": Ear((0.4,), "velocity")}, False),
        ({"others": (Path("elsewhere/b.safetensors"),)}, False),
    ],
)
def test_levels_depend_on_all_that_is_heard(changes: dict[str, object], same: bool) -> None:
    other = replace(PLUCK, **changes)  # type: ignore[arg-type]
    assert (Note(other, SOURCES).matching_key == Note(PLUCK, SOURCES).matching_key) == same
    assert Note(PLUCK, SOURCES[:2]).matching_key != Note(PLUCK, SOURCES).matching_key
