"""Windows of the error are those of the engine's metrics, however the take grows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.rendering import Take
from engine.compare.relative import ErrorSums
from engine.pluck import Pluck
from engine.presets import read_info
from engine.values.ear import Ear
from tests.app.takes import append_to

random = np.random.default_rng(3)
TRUTH = random.standard_normal((1501, 101)).astype(np.float32)
MODEL = TRUTH + 0.1 * random.standard_normal((1501, 101)).astype(np.float32)


@pytest.fixture
def take(small_preset: Path) -> Take:
    """At 4 kHz, without a frame."""
    info = read_info(small_preset)
    return Take("small", info, Pluck(0.35, 4.0), (len(TRUTH) - 1) / info.rate_hz, Ear((0.5,)))


def test_windows_are_the_engines_however_the_take_grows(take: Take) -> None:
    course = take.error_course
    for stop in (1, 7, 33, 34, 900, 1501):
        append_to(take, MODEL[take.ready_frames : stop], TRUTH[take.ready_frames : stop])
    assert course.ready == course.windows
    edges_s = np.arange(course.windows + 1) * course.window_s
    sums = ErrorSums(1500)
    sums.add(*(motion[None, 1:] for motion in (MODEL, TRUTH)))
    expected = sums.windows(take.info.rate_hz, list(edges_s))
    assert course.curves["mae"] == pytest.approx([window.rel_mae for window in expected])
    assert course.curves["rmse"] == pytest.approx([window.rel_mse**0.5 for window in expected])
    assert course.middle_s[-1] < take.seconds


def test_a_model_twice_as_loud(take: Take) -> None:
    append_to(take, 2 * TRUTH, TRUTH)
    course = take.error_course
    assert course.curves["level_db"][0] == pytest.approx(20 * np.log10(2))
    assert course.curves["rmse"][0] == course.curves["mae"][0] == pytest.approx(1)


def test_a_silent_model_has_no_level(take: Take) -> None:
    append_to(take, 0 * TRUTH, TRUTH)
    course = take.error_course
    assert np.isnan(course.curves["level_db"][0])
    assert course.curves["mae"][0] == 1
