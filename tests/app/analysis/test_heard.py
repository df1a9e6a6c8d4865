"""What is read off a take as it is heard, against the whole signal taken at once."""

from __future__ import annotations

import numpy as np
import pytest

from app.analysis.heard import HeardMotion, HeardSignal
from app.rendering import Take
from app.rendering.take import Motion
from app.rendering.velocity import Differentiator
from app.shared.vocabulary import DIFFERENCE
from engine.pluck import Pluck
from engine.presets import PresetInfo, TrainedRange
from engine.resonators.string import StringParameters
from engine.voices import Ear

INFO = PresetInfo("t", "koopman_var", {}, StringParameters(), True, "gaussian", 4_000, 10, 101, 400, 1e-3,
                  TrainedRange(None, None, (1e-3, 1e-2)), "paper", 0)  # fmt: skip
PLACES = np.linspace(0, 1, 101)


@pytest.fixture
def take() -> Take:
    """Two modes of the truth, of 1 mm and 0.1 mm at 200 and 440 Hz; the model's second is a tenth too loud."""
    made = Take("t", INFO, Pluck(), 0.5)
    time_s = np.arange(made.frames)[:, None] / INFO.rate_hz
    first = 1e-3 * np.cos(2 * np.pi * 200 * time_s) * np.sin(np.pi * PLACES)
    second = 1e-4 * np.cos(2 * np.pi * 440 * time_s) * np.sin(2 * np.pi * PLACES)
    made.append((first + 1.1 * second).astype(np.float32), (first + second).astype(np.float32))
    return made


def test_displacement_is_the_takes_own_signal(take: Take) -> None:
    heard = HeardSignal(HeardMotion(take, "truth"), Ear((0.37,)))
    assert heard.ready == take.frames
    assert heard.read(100, 300) == pytest.approx(take.signal_m("truth", 0.37, 100, 300), abs=1e-9)
    assert len(heard.read(take.frames - 3, take.frames + 50)) == 3
    assert len(heard.read(take.frames + 1, take.frames + 2)) == 0


@pytest.mark.parametrize("split", [1, 31, 64, 777])
def test_any_part_of_a_velocity_is_a_part_of_the_whole(take: Take, split: int) -> None:
    heard = HeardSignal(HeardMotion(take, "truth"), Ear((0.37,), "velocity"))
    whole = Differentiator(INFO.rate_hz).feed(take.signal_m("truth", 0.37)[:, None], last=True)[:, 0]
    parts = [heard.read(first, first + split) for first in range(0, take.frames, split)]
    assert np.concatenate(parts) == pytest.approx(whole, abs=1e-5)
    assert np.abs(whole).max() == pytest.approx(2 * np.pi * (200e-3 * np.sin(0.37 * np.pi)), rel=0.2)


def test_a_velocity_waits_for_what_follows(take: Take) -> None:
    """What is told early is what is told at the end."""
    growing = Take("t", INFO, Pluck(), 0.5)
    motion = take.motion_m("truth")
    growing.append(motion[:200], motion[:200])
    ears = Ear((0.37,), "velocity")
    early = HeardSignal(HeardMotion(growing, "truth"), ears)
    assert 100 < early.ready < 200
    whole = HeardSignal(HeardMotion(take, "truth"), ears)
    assert early.read(0, 200) == pytest.approx(whole.read(0, early.ready), abs=1e-6)


def test_the_difference_has_its_gain_and_solo_is_one_mode(take: Take) -> None:
    at = 0.25  # where the second mode is largest
    difference = HeardSignal(HeardMotion(take, DIFFERENCE, 10.0), Ear((at,))).read(0, 9_999)
    alone = HeardSignal(HeardMotion(take, "truth"), Ear((at,), solo=2)).read(0, 9_999)
    assert np.abs(alone).max() == pytest.approx(1e-4, rel=1e-3)
    assert difference == pytest.approx(alone, abs=1e-7)  # a tenth, ten times as loud
    assert not HeardSignal(HeardMotion(take, "truth"), Ear((at,), solo=200)).read(0, 9).any()


def test_another_preset_has_its_own_rate_and_is_there_when_it_has_begun(take: Take) -> None:
    other = HeardMotion(take, "preset:other")
    assert not other.there
    take.others["preset:other"] = Motion(1_000, 11, 0.5)
    assert not other.there
    take.others["preset:other"].append(np.ones((40, 11), np.float32))
    assert other.there
    assert (other.rate_hz, other.frames, other.ready, other.grid_points) == (1_000, 501, 40, 11)
    assert len(HeardSignal(other, Ear((0.5,))).read(0, 501)) == 40
