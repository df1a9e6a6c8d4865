"""Faults of a preset's sound, each by its name, the worst first."""

from dataclasses import replace

import pytest

from training.heard_file import Heard
from training.heard_words import faults, heard_sentence, heard_word

TRUE = Heard("x", "0" * 64, 4.0, 0.2, 0.5, 0.0, 1.0)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({}, []),
        ({"level_db": 1.9, "rise_db": 5.0, "pitch_cents": -2.9}, []),  # a beat alone does not grow
        ({"level_db": 5.2, "rise_db": 3.0}, ["grows, +5 dB"]),
        ({"level_db": 5.2}, ["fades too slowly, +5 dB"]),
        ({"pitch_cents": 13.1}, ["pitch 13 cents too high"]),
        ({"pitch_cents": None}, []),
        ({"split_cents": 22.2, "pitch_cents": -7.0}, ["two pitches, 22 cents apart", "pitch 7 cents too low"]),
        ({"pitch_cents": 12.0, "level_db": -7.6}, ["pitch 12 cents too high", "decays too fast, −8 dB"]),
        ({"hum_db": -66.0, "level_db": 3.0}, ["residual hum at −66 dB", "fades too slowly, +3 dB"]),
        ({"hum_db": -90.0}, []),
        ({"runs_away_s": 3.21, "pitch_cents": 400.0}, ["diverges after 3.2 s", "pitch 400 cents too high"]),
    ],
)
def test_faults_are_named_the_worst_first(changes, named):
    heard = replace(TRUE, **changes)
    assert faults(heard) == named
    word = heard_word(heard)
    assert word.startswith(named[0] if named else "true")
    assert word.endswith("…") == (len(named) > 1)
    assert all(fault in heard_sentence(heard, "x") for fault in named)
