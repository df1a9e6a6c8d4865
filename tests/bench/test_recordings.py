"""The figures of recordings, on synthetic notes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.bench.recordings.evaluate import at_level, below, held_out, table, with_level
from tests.bench.recordings.gate import PASSED, as_data, outcomes, rows
from tests.bench.recordings.instrument import attacks, neighbours
from tests.bench.recordings.pitch import pitches, pitches_of
from tests.bench.recordings.synthetic import synthetic_note
from training.recording.fit import LearnedNote
from training.recording.glide import CENTS, Glide
from training.recording.refine import Pole


def test_pitch_is_found_blind_and_named() -> None:
    values = pitches(3, lambda share: None)
    assert sum(map(len, values.values())) == 3
    made = synthetic_note(1, 1.0, f0_range_hz=(109.9, 110.1))
    named = {f"bass_{name}_fa": (made.samples, made.rate_hz) for name in ("a2", "b2", "take")}
    assert pitches_of(named) == {"recordings, f0 within 50 cents": [1.0, 0.0]}


def test_shares_of_the_gate_are_of_judged_recordings() -> None:
    sound = synthetic_note(1, 1.2, f0_range_hz=(190.0, 200.0)).samples[:, None]  # as a file of one channel is read
    found = outcomes({"a": (sound, 44_100), "b": (sound, 44_100)}, 1, 0)
    assert {each.case.base for each in found if each.case.kind == "as recorded"} == {"a"}
    table = {row[0]: row[1:] for row in rows(found)}
    assert table["all notes"][0] == 16 + 2
    assert {each.end for each in found if each.case.base == "a" and each.case.is_note} == {PASSED}
    assert table["all others"][1] > 0
    assert table["all notes"][0] + table["all others"][0] == len(found) == len(as_data(found))


def test_a_key_of_neighbouring_pitch_is_compared_with_its_recording() -> None:
    made = [synthetic_note(5, 1.0, f0_range_hz=(hz, 1.0001 * hz)) for hz in (180.0, 214.0)]  # three semitones
    found = {f"string_{name}_fa": (each.samples, each.rate_hz) for name, each in zip("ab", made, strict=True)}
    values = neighbours(found, lambda share: None)
    assert len(values["neighbour, distance in dB"]) == 2
    assert all(np.isfinite(each).all() for each in values.values())
    assert max(values["neighbour, distance in dB"]) < 20
    measured = attacks({"string_a_fa": found["string_a_fa"]}, lambda share: None)
    without, learned = (
        measured[f"first 30 ms {name}, distance in dB"][0] for name in ("without an attack", "as learned")
    )
    assert learned <= without + 0.05
    rows = {row[0]: row[1:] for row in table({"a share": [1.0, 0.0], "a figure": [0.5, 2.0]})}
    assert rows["a share, share"] == (0.5, None, 2)
    assert rows["a figure"][0] == pytest.approx(1.25)


def test_a_softer_stroke_glides_less() -> None:
    """Its level is found with its pitch; gain, delay and pitch alone do not give its glide."""
    rate, shares = 4_000, np.array([10.0, 30.0, 10.0]) * CENTS
    poles = [Pole(complex(-2.0 * k, 2 * math.pi * 100 * k), 1 / k + 0j, k) for k in range(1, 7)]
    loud = LearnedNote(rate, 100.0, 0.0, Glide(shares), (*poles, Pole(-9.0 + 6_000j, 0.1 + 0j)))
    t = np.arange(2 * rate) / rate
    truth = 0.1 * at_level(loud, 0.8).render(t * 2 ** (2 / 1200))
    error, pitch = held_out(truth, loud.render, t, rate)
    assert error > 0.02
    assert with_level(truth, lambda level: at_level(loud, level).render, t, rate, pitch) < 1e-3
    assert len(below(loud, 1_500).poles) == 5  # 600 Hz and less
