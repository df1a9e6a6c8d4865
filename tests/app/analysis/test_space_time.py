"""The picture of the string over time: nothing is lost, at any zoom, and what is drawn stays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from app.analysis.space_time import Envelopes, detail_for, picture
from app.rendering import Take
from tests.app.takes import append_to

FRAMES, RATE_HZ = 4001, 4000
random = np.random.default_rng(1)
MODEL, TRUTH = (random.standard_normal((FRAMES, 101)).astype(np.float32) for _ in range(2))


def grown(take: Take) -> Envelopes:
    envelopes = Envelopes(take)
    while envelopes.advance():
        pass
    return envelopes


def test_envelopes_are_the_same_however_the_take_grows(make_take: Callable[..., Take]) -> None:
    whole = grown(make_take(MODEL, TRUTH))
    take = make_take(MODEL, TRUTH, 1)
    piecewise = Envelopes(take)
    assert not piecewise.advance()
    for stop in (3, 4, 1000, FRAMES):
        append_to(take, MODEL[take.ready_frames : stop], TRUTH[take.ready_frames : stop])
        while piecewise.advance():
            pass
    assert whole.complete
    assert piecewise.complete
    for name, motion in (("model", MODEL), ("truth", TRUTH), ("error", MODEL - TRUTH)):
        np.testing.assert_array_equal(piecewise.largest_m(name), whole.largest_m(name))
        np.testing.assert_array_equal(whole.largest_m(name)[7], np.abs(motion[28:32]).max(axis=0))


@pytest.mark.parametrize(("quantity", "motion"), [("model", MODEL), ("error", MODEL - TRUTH)])
def test_zoomed_in_every_frame_is_drawn_at_its_time(make_take: Callable[..., Take], quantity, motion) -> None:
    made = picture(grown(make_take(MODEL, TRUTH)), quantity, (0.1, 0.12), 300)
    assert made is not None
    assert made.detail == "frames"
    first, last = round(made.start_s * RATE_HZ), round(made.stop_s * RATE_HZ)
    assert first / RATE_HZ <= 0.1
    assert last / RATE_HZ >= 0.12
    np.testing.assert_array_equal(made.displacement_m, motion[first:last].T)


@pytest.mark.parametrize(("stop_s", "detail"), [(0.05, "extremes"), (1.0, "envelope")])
def test_a_single_frame_is_seen_at_any_zoom(make_take: Callable[..., Take], stop_s: float, detail: str) -> None:
    motion = np.zeros((FRAMES, 101), np.float32)
    motion[123, 40] = -1e-3
    made = picture(grown(make_take(motion, motion)), "truth", (0.0, stop_s), 150)
    assert made is not None
    assert made.detail == detail
    place, column = np.argwhere(made.displacement_m)[0]
    assert np.count_nonzero(made.displacement_m) == 1
    assert made.displacement_m[place, column] == np.float32(-1e-3 if detail == "extremes" else 1e-3)
    columns = made.displacement_m.shape[1]
    column_s = (made.stop_s - made.start_s) / columns
    assert place == 40
    assert abs(made.start_s + (column + 0.5) * column_s - 123 / RATE_HZ) <= column_s + 0.001


@pytest.mark.parametrize("times_s", [(0.0, 1.0), (0.2, 0.3), (0.24, 0.26)])
def test_what_has_been_drawn_stays_while_the_take_grows(make_take: Callable[..., Take], times_s) -> None:
    part = picture(grown(make_take(MODEL, TRUTH, 1009)), "model", times_s, 90)
    whole = picture(grown(make_take(MODEL, TRUTH)), "model", times_s, 90)
    assert part is not None
    assert whole is not None
    columns = part.displacement_m.shape[1]
    assert 0 < columns < whole.displacement_m.shape[1]
    np.testing.assert_array_equal(part.displacement_m, whole.displacement_m[:, :columns])


def test_there_is_nothing_past_what_is_rendered(make_take: Callable[..., Take]) -> None:
    assert picture(grown(make_take(MODEL, TRUTH, 400)), "model", (0.5, 0.6), 100) is None


def test_signs_are_drawn_as_long_as_columns_are_short_against_a_period(make_take: Callable[..., Take]) -> None:
    take = make_take(MODEL, TRUTH)
    period_s = 1 / take.fundamental_hz
    assert detail_for(take, (0, 10 * period_s), 125) == "extremes"
    assert detail_for(take, (0, 10 * period_s), 115) == "envelope"


def test_the_typical_displacement_ignores_a_short_peak(make_take: Callable[..., Take]) -> None:
    motion = np.full((FRAMES, 101), 1e-3, np.float32)
    motion[:40] = 1.0
    envelopes = grown(make_take(motion, motion))
    assert envelopes.typical_m("truth", (0.0, 1.0)) == pytest.approx(1.5e-3)
    assert envelopes.typical_m("truth", (0.0, 0.005)) == pytest.approx(1.5)
    assert envelopes.typical_m("error", (0.0, 1.0)) == 0
