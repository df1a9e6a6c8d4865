"""What is read off a take as it is seen and heard."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from app.analysis.heard import HeardSignal
from app.rendering import Take
from app.shared.vocabulary import DIFFERENCE
from engine.pluck import Pluck
from engine.presets import PresetInfo, TrainedRange
from engine.values.ear import Ear
from engine.values.string import StringParameters
from tests.app.takes import append_to

INFO = PresetInfo("t", "koopman_var", {}, StringParameters(), True, "gaussian", 4_000, 10, 101, 400, 1e-3,
                  TrainedRange(None, None, (1e-3, 1e-2)), "paper", 0)  # fmt: skip
PLACES = np.linspace(0, 1, 101)


@pytest.fixture
def take(hear: Callable[[Take, Ear], None]) -> Take:
    """Two modes of the truth, of 1 mm and 0.1 mm at 200 and 440 Hz; the model's second is a tenth too loud."""
    made = Take("t", INFO, Pluck(), 0.5, Ear((0.5,)))
    time_s = np.arange(made.frames)[:, None] / INFO.rate_hz
    first = 1e-3 * np.cos(2 * np.pi * 200 * time_s) * np.sin(np.pi * PLACES)
    second = 1e-4 * np.cos(2 * np.pi * 440 * time_s) * np.sin(2 * np.pi * PLACES)
    append_to(made, (first + 1.1 * second).astype(np.float32), (first + second).astype(np.float32))
    hear(made, Ear((0.37, 0.6)))
    return made


def test_a_signal_is_the_takes_own_at_the_first_point(take: Take) -> None:
    heard = HeardSignal(take.listened.signals, "truth")
    assert heard.there
    assert (heard.ready, heard.frames, heard.rate_hz) == (2_001, 2_001, 4_000)
    assert heard.read(100, 300) == pytest.approx(take.motion_m("truth")[100:300, 37], abs=1e-9)
    assert heard.read_all(100, 300)[:, 1] == pytest.approx(take.motion_m("truth")[100:300, 60], abs=1e-9)
    assert len(heard.read(take.frames - 3, take.frames + 50)) == 3
    assert len(heard.read(take.frames + 1, take.frames + 2)) == 0


def test_the_difference_has_its_gain(take: Take, hear: Callable[[Take, Ear], None]) -> None:
    hear(take, Ear((0.25,)))  # where the second mode is largest
    difference = HeardSignal(take.listened.signals, DIFFERENCE, 10.0).read(0, 9_999)
    hear(take, Ear((0.25,), solo=2))
    alone = HeardSignal(take.listened.signals, "truth").read(0, 9_999)
    assert np.abs(alone).max() == pytest.approx(1e-4, rel=1e-3)
    assert difference == pytest.approx(alone, abs=1e-7)  # a tenth, ten times as loud
