"""The picture of a moment, and what is read off a take as it is seen and heard."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from app.analysis.heard import HeardMotion, HeardSignal
from app.analysis.moment import Envelope, frame_at
from app.rendering import Take
from app.rendering.take import Pictures
from app.shared.vocabulary import DIFFERENCE
from engine.values.ear import Ear

PLACES = np.linspace(0, 1, 101)
TIME_S = np.arange(4_001)[:, None] / 4_000
STILL = np.zeros((4_001, 101), np.float32)
MakeTake = Callable[..., Take]


@pytest.fixture
def sines(make_take: MakeTake) -> Take:
    """A second in which both sources swing as one sine of the fundamental; the model at half the amplitude."""
    turn = 2 * np.pi * make_take(STILL, STILL).fundamental_hz
    truth = (1e-3 * np.cos(turn * TIME_S) * np.sin(np.pi * PLACES)).astype(np.float32)
    return make_take(truth / 2, truth)


def both(take: Take) -> list[HeardMotion]:
    return [HeardMotion(take.motions, name) for name in ("model", "truth")]


def test_signals_are_the_takes_own_at_their_points_and_the_difference_has_its_gain(
    make_take: MakeTake, hear: Callable[[Take, Ear], None]
) -> None:
    first, second = (
        size_m * np.cos(2 * np.pi * hz * TIME_S) * np.sin(mode * np.pi * PLACES)
        for mode, size_m, hz in ((1, 1e-3, 200), (2, 1e-4, 440))
    )
    take = make_take((first + 1.1 * second).astype(np.float32), (first + second).astype(np.float32))
    hear(take, Ear((0.37, 0.6)))
    heard = HeardSignal(take.listened.signals, "truth")
    assert (heard.there, heard.ready, heard.frames, heard.rate_hz) == (True, 4_001, 4_001, 4_000)
    assert heard.read(100, 300) == pytest.approx(take.motion_m("truth")[100:300, 37], abs=1e-9)
    assert heard.read_all(100, 300)[:, 1] == pytest.approx(take.motion_m("truth")[100:300, 60], abs=1e-9)
    assert [len(heard.read(take.frames + first, take.frames + 50)) for first in (-3, 1)] == [3, 0]
    hear(take, Ear((0.25,)))  # where the second mode is largest
    difference = HeardSignal(take.listened.signals, DIFFERENCE, 10.0).read(0, 9_999)
    hear(take, Ear((0.25,), solo=2))
    alone = HeardSignal(take.listened.signals, "truth").read(0, 9_999)
    assert np.abs(alone).max() == pytest.approx(1e-4, rel=1e-3)
    assert difference == pytest.approx(alone, abs=1e-7)  # a tenth, ten times as loud


def test_a_picture_has_the_shape_in_mm_and_the_blur_around_it(sines: Take, make_take: MakeTake) -> None:
    frame = frame_at(sines, both(sines), 0.5, 1.0)
    expected = np.cos(2 * np.pi * sines.fundamental_hz * 0.5)
    assert frame.shapes["truth"][50] == pytest.approx(expected, abs=0.02)
    assert frame.blurs["truth"][1][50] == pytest.approx(1.0, abs=0.02)
    assert frame.blurs["model"][0][50] == pytest.approx(-0.5, abs=0.02)
    assert frame.caption.endswith("past training")
    assert frame_at(sines, both(sines), 0.05, 1.0).caption == "0.050 s"
    empty = make_take(STILL[:1], STILL[:1])
    assert (frame_at(empty, both(empty), 0.0, 1.0).shapes["model"] == 0).all()


def test_an_envelope_holds_the_last_second_and_forgets_what_was_before(make_take: MakeTake) -> None:
    model, truth = (
        np.repeat(np.float32([1e-3, soft]), (4_000, 8_001))[:, None] + STILL[0] for soft in (-1e-4, -5e-5)
    )
    take = make_take(model, truth)
    envelope, motions = Envelope(), both(take)
    assert envelope.before(0.0, motions) == {}
    for position_s, lowest, highest in ((0.5, 1.0, 1.0), (1.5, -0.1, 1.0), (2.5, -0.1, -0.1), (9.0, -0.1, -0.1)):
        low, high = envelope.before(position_s, motions)["model"]
        assert (low[50], high[50]) == (pytest.approx(lowest), pytest.approx(highest))
    assert envelope.before(2.5, motions)["truth"][0][50] == pytest.approx(-0.05)
    assert frame_at(take, motions, 1.5, 1.0, envelope).envelopes["model"][1][50] == pytest.approx(1.0)
    assert frame_at(take, motions, 1.5, 1.0).envelopes == {}


def test_the_difference_and_another_preset_at_its_own_rate_and_grid_move_too(sines: Take) -> None:
    sines.motions["preset:other"] = other = Pictures(1_000, 11, 1.0)
    motions = [HeardMotion(sines.motions, DIFFERENCE, 10.0), HeardMotion(sines.motions, "preset:other")]
    assert set(frame_at(sines, motions, 0.5, 1.0).shapes) == {DIFFERENCE}
    other.append(np.linspace(0, 1e-3, 1_001, dtype=np.float32)[:, None] * np.ones(11, np.float32))
    frame = frame_at(sines, motions, 0.5, 1.0, Envelope())
    assert frame.blurs[DIFFERENCE][0][50] == pytest.approx(-5.0, abs=0.1)
    assert frame.envelopes[DIFFERENCE][1][50] == pytest.approx(5.0, abs=0.1)
    assert frame.shapes["preset:other"] == pytest.approx(np.full(11, 0.5), abs=1e-5)
    for bands in (frame.blurs, frame.envelopes):
        assert bands["preset:other"][1][0] == pytest.approx(0.499, abs=1e-4)
    assert frame_at(sines, [motions[1]], 9.0, 1.0).shapes["preset:other"][0] == pytest.approx(1.0)
