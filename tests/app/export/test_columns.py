"""Columns become CSV that any reader takes back, digit for digit; words from files stay words."""

import csv
from io import StringIO

import numpy as np

from app.export import columns
from app.export.columns import Columns, aligned


def read(made: Columns) -> list[list[str]]:
    return list(csv.reader(StringIO(made.text)))


def test_numbers_come_back_exactly_and_hostile_words_are_words():
    random = np.random.default_rng(0)
    numbers = {
        "single": (random.standard_normal(99) * 10.0 ** random.integers(-30, 30, 99)).astype(np.float32),
        "double": random.standard_normal(99) * 10.0 ** random.integers(-300, 300, 99),
        "whole": random.integers(-(2**40), 2**40, 99),
    }
    heading, *rows = read(Columns(numbers))
    assert heading == list(numbers)
    for name, cells in zip(numbers, zip(*rows, strict=True), strict=True):
        assert (np.array(cells, numbers[name].dtype) == numbers[name]).all(), name
    words = ["=HYPERLINK(1)", "+1", "-1", "@x", 'a "quoted", title', "two\nlines", "Space–time", None, -2.5, np.inf]
    made = read(Columns({"=words, (s)": words, "nan": np.full(len(words), np.nan)}))
    assert made[0] == ["'=words, (s)", "nan"]
    assert [row[0] for row in made[1:]] == [
        *("'=HYPERLINK(1)", "'+1", "'-1", "'@x", 'a "quoted", title', "two\nlines", "Space–time", "", "-2.5", "inf")
    ]
    assert {row[1] for row in made[1:]} == {""}


def test_curves_of_two_rates_share_their_places_and_what_is_too_much_is_said(monkeypatch):
    fast, slow = np.arange(9) / 8, np.arange(5) / 4
    both = aligned("time (s)", {"fast": (fast, 8 * fast), "slow": (slow, np.arange(5, dtype=np.float32))})
    assert read(both)[1:4] == [["0.0", "0.0", "0.0"], ["0.125", "1.0", ""], ["0.25", "2.0", "1.0"]] and not both.words
    monkeypatch.setattr(columns, "MOST_VALUES", 9)
    cut = aligned("time (s)", {"fast": (fast, fast), "slow": (slow, slow)})
    assert cut.rows == 3
    assert read(cut) == read(Columns({"time (s)": fast[:3], "fast": fast[:3], "slow": [0.0, None, 0.25]}))
    assert aligned("time (s)", {}).rows == 0
    assert cut.words == " The first 3 of 9 rows; zoom in for others."
