"""The picture of the string over time: nothing is lost, at any zoom, and what is drawn stays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from app.analysis.space_time import Envelopes, Picture, detail_for, picture
from app.rendering import Take
from tests.app.takes import append_to

FRAMES, RATE_HZ = 4001, 4000
random = np.random.default_rng(1)
MODEL, TRUTH = (random.standard_normal((FRAMES, 101)).astype(np.float32) for _ in range(2))
MOTIONS = {"model": MODEL, "truth": TRUTH, "error": MODEL - TRUTH}
MakeTake = Callable[..., Take]


def grown(take: Take) -> Envelopes:
    envelopes = Envelopes(take)
    while envelopes.advance():
        pass
    return envelopes


def drawn(take: Take, quantity: str, times_s: tuple[float, float], columns: int) -> Picture:
    made = picture(grown(take), quantity, times_s, columns)
    assert made is not None
    return made


def test_envelopes_are_the_same_however_the_take_grows(make_take: MakeTake) -> None:
    whole = grown(make_take(MODEL, TRUTH))
    take = make_take(MODEL, TRUTH, 1)
    piecewise = Envelopes(take)
    assert not piecewise.advance()
    for stop in (3, 4, 1000, FRAMES):
        append_to(take, MODEL[take.ready_frames : stop], TRUTH[take.ready_frames : stop])
        while piecewise.advance():
            pass
    assert whole.complete and piecewise.complete
    for name, motion in MOTIONS.items():
        np.testing.assert_array_equal(piecewise.largest_m(name), whole.largest_m(name))
        np.testing.assert_array_equal(whole.largest_m(name)[7], np.abs(motion[28:32]).max(axis=0))


@pytest.mark.parametrize("quantity", ["model", "error"])
def test_zoomed_in_every_frame_is_drawn_at_its_time(make_take: MakeTake, quantity: str) -> None:
    made = drawn(make_take(MODEL, TRUTH), quantity, (0.1, 0.12), 300)
    first, last = round(made.start_s * RATE_HZ), round(made.stop_s * RATE_HZ)
    assert made.detail == "frames" and made.start_s <= 0.1 and made.stop_s >= 0.12
    np.testing.assert_array_equal(made.displacement_m, MOTIONS[quantity][first:last].T)


@pytest.mark.parametrize(("stop_s", "detail", "seen_m"), [(0.05, "extremes", -1e-3), (1.0, "envelope", 1e-3)])
def test_a_single_frame_is_seen_at_any_zoom(make_take: MakeTake, stop_s: float, detail: str, seen_m: float) -> None:
    motion = np.zeros((FRAMES, 101), np.float32)
    motion[123, 40] = -1e-3
    made = drawn(make_take(motion, motion), "truth", (0.0, stop_s), 150)
    ((place, column),) = np.argwhere(made.displacement_m)
    assert (made.detail, place, made.displacement_m[place, column]) == (detail, 40, np.float32(seen_m))
    column_s = (made.stop_s - made.start_s) / made.displacement_m.shape[1]
    assert abs(made.start_s + (column + 0.5) * column_s - 123 / RATE_HZ) <= column_s + 0.001


@pytest.mark.parametrize("times_s", [(0.0, 1.0), (0.2, 0.3), (0.24, 0.26)])
def test_what_has_been_drawn_stays_while_the_take_grows(make_take: MakeTake, times_s: tuple[float, float]) -> None:
    part, whole = (drawn(make_take(MODEL, TRUTH, ready), "model", times_s, 90) for ready in (1009, None))
    columns = part.displacement_m.shape[1]
    assert 0 < columns < whole.displacement_m.shape[1]
    np.testing.assert_array_equal(part.displacement_m, whole.displacement_m[:, :columns])
    assert picture(grown(make_take(MODEL, TRUTH, 400)), "model", (0.5, 0.6), 100) is None


def test_signs_are_drawn_as_long_as_columns_are_short_against_a_period(make_take: MakeTake) -> None:
    take = make_take(MODEL, TRUTH)
    details = [detail_for(take, (0, 10 / take.fundamental_hz), columns) for columns in (125, 115)]
    assert details == ["extremes", "envelope"]


def test_the_typical_displacement_ignores_a_short_peak(make_take: MakeTake) -> None:
    motion = np.full((FRAMES, 101), 1e-3, np.float32)
    motion[:40] = 1.0
    envelopes = grown(make_take(motion, motion))
    for quantity, stop_s, typical_m in (("truth", 1.0, 1.5e-3), ("truth", 0.005, 1.5), ("error", 1.0, 0)):
        assert envelopes.typical_m(quantity, (0.0, stop_s)) == pytest.approx(typical_m)
