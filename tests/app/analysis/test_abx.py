"""The listening test without its dialog: order, score and p-value, sounds of one level, and results that are kept."""

import json

import numpy as np
import pytest

from app.analysis.abx.record import AbxRecord, Candidate, material_of, p_text, save_record
from app.analysis.abx.sound import END_S, make_stimuli
from app.analysis.abx.trials import Identity, ListeningTest, Trial, draw_order, needed_correct, p_value
from app.presets.library import list_presets
from app.session.choices import Choices
from app.session.slots import sound_of
from engine.kernels.limiter import CEILING
from engine.pluck import Pluck
from engine.values.string import StringParameters

RATE_HZ = 8000
IDENTITIES: tuple[Identity, Identity] = ("A", "B")
TIME_S = np.arange(RATE_HZ)[:, None] / RATE_HZ


@pytest.mark.parametrize("trials", [1, 2, 4, 5, 10, 16, 25, 200])
def test_p_values_and_the_right_answers_that_are_needed_are_those_of_scipy(trials):
    from scipy.stats import binomtest  # which takes seconds to load, and not every worker needs

    expected = [binomtest(correct, trials, 0.5, alternative="greater").pvalue for correct in range(trials + 1)]
    assert [p_value(correct, trials) for correct in range(trials + 1)] == pytest.approx(expected, rel=1e-9)
    assert needed_correct(trials) == next((correct for correct, p in enumerate(expected) if p < 0.05), None)


def test_the_seed_is_the_order_and_the_coin_is_fair():
    assert "".join(draw_order(7, 12)) == "AABABAABAAAA"
    assert draw_order(7, 25)[:12] == draw_order(7, 12)
    counts = [draw_order(seed, 16).count("A") for seed in range(500)]
    assert np.mean(counts) / 16 == pytest.approx(0.5, abs=0.02)
    assert {*counts} >= set(range(4, 13))  # not balanced within a test


def test_a_run_keeps_what_happened_in_each_trial_and_takes_no_answer_without_x():
    order = draw_order(3, 2)
    run = ListeningTest(seed=3, planned=2)
    assert [run.heard_as(name) for name in ("X", "A", "B")] == [order[0], "A", "B"]
    with pytest.raises(ValueError, match="X has not been heard"):
        run.auditioned("A").auditioned("B").answered("A")
    run = run.auditioned("A").auditioned("X").auditioned("X").answered(order[0])
    assert (run.trials, run.x_heard, run.complete) == ((Trial(x=order[0], answer=order[0]),), False, False)
    run = run.auditioned("X").answered("A" if order[1] == "B" else "B")
    assert run.complete
    assert [trial.correct for trial in run.trials] == [True, False]
    with pytest.raises(ValueError, match="complete"):
        run.answered("A")


def record_of(planned: int, right: int, answered: int) -> AbxRecord:
    """A run in which the first `right` answers are right."""
    run = ListeningTest(seed=5, planned=planned)
    for place in range(answered):
        x = run.heard_as("X")
        run = run.auditioned("X").answered(x if (place < right) else "B" if x == "A" else "A")
    a, b = (Candidate(label=label, preset="nylon", preset_sha256="0f" * 32) for label in ("Model", "Truth"))
    pluck, through = {"position": 0.35}, {"device": "Headphones"}
    return AbxRecord(a=a, b=b, pluck=pluck, through=through, planned_trials=planned, seed=5, trials=run.trials)


def test_results_come_back_the_same_and_none_is_overwritten(tmp_path):
    record, stopped = record_of(10, 9, 10), record_of(10, 3, 4)
    assert (record.correct, record.p_value) == (9, pytest.approx(11 / 1024))
    assert record.date.tzinfo is not None
    later = stopped.model_copy(update={"date": record.date})
    paths = [save_record(tmp_path / "new" / "folder", made) for made in (record, later, later)]
    assert sorted(paths[0].parent.iterdir()) == sorted({*paths})
    first, *others = (AbxRecord.model_validate_json(path.read_bytes()) for path in paths)
    assert first == record and others == [later, later]
    written = json.loads(paths[0].read_text())
    assert (written["correct"], written["p_value"]) == (9, record.p_value)
    assert (later.complete, later.p_value, len(later.trials)) == (False, None, 4)
    assert later.verdict.startswith("The test was not completed")
    assert (p_text(0.0384), p_text(2.0**-25)) == ("p = 0.038", "p < 0.001")


def test_the_chosen_pluck_and_string_are_kept(preset_folder):
    entry = list_presets(preset_folder)[0][0]
    for stereo, chosen in ((False, None), (True, StringParameters())):
        choices = Choices(single=entry.name, pluck=Pluck(0.3), string=chosen).changed({"stereo": stereo})
        pluck = material_of(sound_of(choices, entry.path), "", 0.0).pluck
        assert (pluck["pluck"], pluck["string"], pluck["ear"]) == (Pluck(0.3), chosen, choices.ear)


def decay(hz: float, peak: float) -> np.ndarray:
    """(frames, 1)"""
    return peak * np.exp(-3 * TIME_S) * np.sin(2 * np.pi * hz * TIME_S)


def test_levels_are_equal_and_gains_are_reported():
    model, truth = decay(200, 0.4), decay(200, 0.1)
    made = make_stimuli({"model": truth, "truth": model}, RATE_HZ)
    a, b = (made.samples[name] for name in IDENTITIES)
    assert np.square(a, dtype=float).mean() == pytest.approx(np.square(b, dtype=float).mean(), rel=2e-6)
    kept = RATE_HZ - round(END_S * RATE_HZ)  # before the fade at the end
    for found, given, gain_db in ((a, truth, made.gains_db[0]), (b, model, made.gains_db[1])):
        np.testing.assert_allclose(found[:kept], (given * 10 ** (gain_db / 20))[:kept], atol=1e-7)
    assert made.gains_db == pytest.approx((0.0, -12.041), abs=1e-3)


@pytest.mark.parametrize("volume_db", [-20.0, 0.0, 12.0])
def test_two_overlapping_sounds_stay_below_the_limiter(volume_db):
    made = make_stimuli({"model": decay(200, 1.4), "truth": decay(300, 0.9)}, RATE_HZ, volume_db)
    peak = max(np.abs(made.samples[name]).max() for name in IDENTITIES)
    assert 2 * peak * 10 ** (volume_db / 20) <= CEILING * 1.000001
    assert max(made.gains_db) <= 0


@pytest.mark.parametrize(("hz", "same", "trivial"), [(200, True, False), (450, False, True), (200.2, False, False)])
def test_sounds_that_say_nothing_are_noticed(hz, same, trivial):
    made = make_stimuli({"model": decay(200, 0.5), "truth": decay(hz, 0.5)}, RATE_HZ)
    assert (made.same, made.trivial) == (same, trivial)


def test_silence_is_refused():
    for frames in (RATE_HZ, 0):
        with pytest.raises(ValueError, match="Truth is silent"):
            make_stimuli({"model": decay(200, 0.5), "truth": np.zeros((frames, 1))}, RATE_HZ)


def test_a_turn_ends_in_silence_as_it_is_looped_and_both_sides_stay():
    stereo = decay(200, 0.5) * (1, 0.25) + 0.1
    made = make_stimuli({"model": stereo, "truth": stereo[:, ::-1]}, RATE_HZ)
    for name in IDENTITIES:
        assert made.samples[name].shape == (RATE_HZ, 2)
        assert np.abs(made.samples[name][-1]).max() < 1e-3
        assert np.abs(made.samples[name][-round(0.01 * RATE_HZ)]).max() > 0.01
