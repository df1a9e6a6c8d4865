"""Figures that a person can read."""

from __future__ import annotations

import pytest

from app.presets.words import percent


@pytest.mark.parametrize(
    ("share", "words"),
    [
        (0.0, "< 0.001 %"),
        (1e-7, "< 0.001 %"),
        (1.2e-5, "0.0012 %"),
        (0.0345, "3.5 %"),
        (0.5, "50 %"),
        (1.16, "116 %"),
    ],
)
def test_a_percentage_has_few_digits_and_no_exponent(share: float, words: str) -> None:
    assert percent(share) == words
