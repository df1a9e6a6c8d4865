"""Names of keys: as they are written, and other spellings."""

from __future__ import annotations

import pytest

from app.shared.key_names import key_named, note_name


def test_every_name_is_read_as_it_is_written() -> None:
    assert [key_named(note_name(key)) for key in range(128)] == list(range(128))


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("e2", 40),
        ("F#3", 54),
        ("Gb3", 54),
        ("G♭3", 54),
        (" 54 ", 54),
        ("C-1", 0),
        ("H2", None),
        ("E", None),
        ("", None),
        ("9" * 5_000, None),
    ],
)
def test_other_spellings(text: str, key: int | None) -> None:
    assert key_named(text) == key
