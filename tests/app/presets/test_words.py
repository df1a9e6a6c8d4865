"""Figures that a person can read."""

from __future__ import annotations

import math

import pytest

from app.presets.words import judged, percent


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


@pytest.mark.parametrize(
    ("error", "words", "grave"),
    [(math.nan, "{}", False), (1e-6, "accurate, although {}", False), (0.03, "inaccurate: {}", True)],
)
def test_the_measured_error_decides_whether_to_warn(error: float, words: str, grave: bool) -> None:
    outside = "decay time near 3 kHz 1.9 s is outside the trained 0.1 … 1 s"
    assert judged(outside, error) == (words.format(outside), grave)
    assert judged("", error) == ("", False)
