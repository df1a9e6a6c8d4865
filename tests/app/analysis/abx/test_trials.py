"""Order, score and p-value against known figures."""

from __future__ import annotations

import pytest
from scipy.stats import binomtest

from app.analysis.abx.trials import ListeningTest, Trial, draw_order, needed_correct, p_value


@pytest.mark.parametrize("trials", [1, 2, 16, 25, 200])
def test_p_values_are_those_of_scipy(trials: int) -> None:
    for correct in range(trials + 1):
        expected = binomtest(correct, trials, 0.5, alternative="greater").pvalue
        assert p_value(correct, trials) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("trials", "needed"), [(4, None), (5, 5), (10, 9), (16, 12), (25, 18)])
def test_how_many_right_answers_are_needed(trials: int, needed: int | None) -> None:
    assert needed_correct(trials) == needed


def test_the_seed_is_the_order() -> None:
    assert "".join(draw_order(7, 12)) == "AABABAABAAAA"
    assert draw_order(7, 25)[:12] == draw_order(7, 12)
    assert draw_order(8, 25) != draw_order(7, 25)


def test_the_coin_is_fair() -> None:
    drawn = [draw_order(seed, 16) for seed in range(500)]
    share = sum(order.count("A") for order in drawn) / (500 * 16)
    assert share == pytest.approx(0.5, abs=0.02)
    assert {order.count("A") for order in drawn} >= set(range(4, 13))  # not balanced within a test


def test_a_run_keeps_what_happened_in_each_trial() -> None:
    order = draw_order(3, 2)
    run = ListeningTest(seed=3, planned=2)
    assert run.heard_as("X") == order[0]
    assert (run.heard_as("A"), run.heard_as("B")) == ("A", "B")
    run = run.auditioned("A").auditioned("X").auditioned("X").answered(order[0])
    assert run.trials == (Trial(x=order[0], answer=order[0]),)
    assert (len(run.trials), run.x_heard, run.complete) == (1, False, False)
    wrong = "A" if order[1] == "B" else "B"
    run = run.auditioned("X").answered(wrong)
    assert run.complete
    assert [trial.correct for trial in run.trials] == [True, False]
    with pytest.raises(ValueError, match="complete"):
        run.answered("A")


def test_without_hearing_x_there_is_no_answer() -> None:
    with pytest.raises(ValueError, match="X has not been heard"):
        ListeningTest(seed=1, planned=3).auditioned("A").auditioned("B").answered("A")
