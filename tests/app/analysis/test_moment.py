"""The picture of a moment."""

import numpy as np
import pytest
import torch

from app.analysis.heard import HeardMotion
from app.analysis.moment import Envelope, frame_at
from app.rendering import Take
from app.rendering.take import Pictures
from app.shared.vocabulary import DIFFERENCE
from engine.pluck import Pluck
from engine.presets import PresetInfo, TrainedRange
from engine.values.ear import Ear
from engine.values.string import StringParameters
from tests.app.takes import append_to

INFO = PresetInfo("t", "koopman_var", {}, StringParameters(), True, "gaussian", 4_000, 10, 101, 400, 1e-3,
                  TrainedRange(None, None, (1e-3, 1e-2)), "paper", 0)  # fmt: skip


def sine_take(seconds: float = 1.0) -> Take:
    """Both sources swing as one sine in time of the fundamental; the model at half the amplitude."""
    take = Take("t", INFO, Pluck(), seconds, Ear((0.5,)))
    time_s = np.arange(take.frames) / INFO.rate_hz
    shape = np.sin(np.pi * np.linspace(0, 1, 101))
    truth = (1e-3 * np.cos(2 * np.pi * take.fundamental_hz * time_s)[:, None] * shape).astype(np.float32)
    append_to(take, truth / 2, truth)
    return take


def both(take: Take) -> list[HeardMotion]:
    return [HeardMotion(take.motions, name) for name in ("model", "truth")]


def test_a_picture_has_the_shape_in_mm_and_the_blur_around_it() -> None:
    take = sine_take()
    frame = frame_at(take, both(take), 0.5, 1.0)
    expected = 1.0 * np.cos(2 * np.pi * take.fundamental_hz * 0.5)
    assert frame.shapes["truth"][50] == pytest.approx(expected, abs=0.02)
    assert frame.blurs["truth"][1][50] == pytest.approx(1.0, abs=0.02)
    assert frame.blurs["model"][0][50] == pytest.approx(-0.5, abs=0.02)
    assert frame.caption.endswith("past training")
    assert frame_at(take, both(take), 0.05, 1.0).caption == "0.050 s"


def test_an_envelope_holds_the_last_second_and_forgets_what_was_before() -> None:
    take = Take("t", INFO, Pluck(), 3.0, Ear((0.5,)))
    loud, soft = np.full((4_000, 101), 1e-3, np.float32), np.full((8_001, 101), -1e-4, np.float32)
    append_to(take, loud, loud)
    envelope, motions = Envelope(), both(take)
    assert envelope.before(0.0, motions) == {}
    append_to(take, soft, soft / 2)
    for position_s, lowest, highest in ((0.5, 1.0, 1.0), (1.5, -0.1, 1.0), (2.5, -0.1, -0.1), (9.0, -0.1, -0.1)):
        low, high = envelope.before(position_s, motions)["model"]
        assert (low[50], high[50]) == (pytest.approx(lowest), pytest.approx(highest))
    assert envelope.before(2.5, motions)["truth"][0][50] == pytest.approx(-0.05)
    assert frame_at(take, both(take), 1.5, 1.0, envelope).envelopes["model"][1][50] == pytest.approx(1.0)
    assert frame_at(take, both(take), 1.5, 1.0).envelopes == {}


def test_the_difference_and_another_preset_move_too() -> None:
    """The difference with its gain; the other at its own rate and on its own grid, once there is something of it."""
    take = sine_take()
    take.motions["preset:other"] = Pictures(1_000, 11, 1.0)
    motions = [HeardMotion(take.motions, DIFFERENCE, 10.0), HeardMotion(take.motions, "preset:other")]
    assert set(frame_at(take, motions, 0.5, 1.0).shapes) == {DIFFERENCE}
    take.motions["preset:other"].append(
        np.linspace(0, 1e-3, 1_001, dtype=np.float32)[:, None] * np.ones(11, np.float32)
    )
    envelope = Envelope()
    frame = frame_at(take, motions, 0.5, 1.0, envelope)
    assert frame.blurs[DIFFERENCE][0][50] == pytest.approx(-5.0, abs=0.1)
    assert frame.shapes["preset:other"] == pytest.approx(np.full(11, 0.5), abs=1e-5)
    assert frame.blurs["preset:other"][1][0] == pytest.approx(0.499, abs=1e-4)
    assert frame.envelopes["preset:other"][1][0] == pytest.approx(0.499, abs=1e-4)
    assert frame.envelopes[DIFFERENCE][1][50] == pytest.approx(5.0, abs=0.1)
    assert frame_at(take, [motions[1]], 9.0, 1.0).shapes["preset:other"][0] == pytest.approx(1.0)


def test_an_empty_take_has_a_picture() -> None:
    take = Take("t", INFO, Pluck(), 1.0, Ear((0.5,)))
    append_to(take, np.zeros((1, 101), np.float32), np.zeros((1, 101), np.float32))
    assert torch.tensor(frame_at(take, both(take), 0.0, 1.0).shapes["model"]).eq(0).all()
