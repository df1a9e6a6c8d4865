"""Parts of a take, however it grows: the windows of its error, and the moments that slow motion shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.rendering import Take
from app.rendering.strobe import FLASH_HZ, Flashes, Strobe
from engine.compare.relative import ErrorSums
from engine.pluck import Pluck
from engine.presets import read_info
from engine.values.ear import Ear
from tests.app.takes import append_to

random = np.random.default_rng(3)
TRUTH = random.standard_normal((1501, 101)).astype(np.float32)
MODEL = TRUTH + 0.1 * random.standard_normal((1501, 101)).astype(np.float32)
HZ = 247.0


@pytest.fixture
def take(small_preset: Path) -> Take:
    """A take at 4 kHz, without a frame."""
    return Take("small", read_info(small_preset), Pluck(0.35, 4.0), 1500 / 4000, Ear((0.5,)))


def test_windows_are_the_engines_however_the_take_grows(take: Take) -> None:
    course = take.error_course
    for stop in (1, 7, 33, 34, 900, 1501):
        append_to(take, MODEL[take.ready_frames : stop], TRUTH[take.ready_frames : stop])
    assert course.ready == course.windows
    sums = ErrorSums(1500)
    sums.add(*(motion[None, 1:] for motion in (MODEL, TRUTH)))
    expected = sums.windows(take.info.rate_hz, list(np.arange(course.windows + 1) * course.window_s))
    assert course.curves["mae"] == pytest.approx([window.rel_mae for window in expected])
    assert course.curves["rmse"] == pytest.approx([window.rel_mse**0.5 for window in expected])
    assert course.middle_s[-1] < take.seconds


@pytest.mark.parametrize(("gain", "level_db"), [(2, 20 * np.log10(2)), (0, np.nan)])
def test_a_louder_or_a_silent_model(take: Take, gain: int, level_db: float) -> None:
    append_to(take, gain * TRUTH, TRUTH)
    curves = take.error_course.curves
    assert curves["level_db"][0] == pytest.approx(level_db, nan_ok=True)
    assert curves["rmse"][0] == curves["mae"][0] == pytest.approx(1)


def test_slow_motion_stays_within_a_period_of_the_playhead_and_moves_slowly() -> None:
    places_s = np.arange(FLASH_HZ + 1) / FLASH_HZ
    times_s = Strobe(0.004, HZ, 1.0).times_s
    assert np.abs(times_s - places_s).max() <= 1 / HZ
    turns = np.diff(np.unwrap(2 * np.pi * (times_s[:-1] * HZ % 1.0))) / (2 * np.pi)
    assert turns == pytest.approx(np.full(len(turns), 0.004 * HZ / FLASH_HZ), abs=1e-6)
    assert Strobe(1.0, HZ, 1.0).times_s == pytest.approx(places_s), "in real time the playhead itself"


@pytest.mark.parametrize("block", [1, 7, 100, 5_000])
def test_flashes_lie_between_the_frames_around_them_however_they_come(block: int) -> None:
    rate_hz, frames, ready = 1_000, 1_001, [0]
    strobe = Strobe(0.01, HZ, 1.0)
    places_s = (-1.0, 0.0, 1.4 / FLASH_HZ, 0.999, 1.0, 9.0)
    assert [strobe.flash(place_s) for place_s in places_s] == [0, 0, 1, FLASH_HZ - 1, FLASH_HZ, FLASH_HZ]
    flashes = Flashes(strobe, rate_hz, frames, 101)
    for first in range(0, frames, block):
        stop = min(first + block, frames)
        numbers = flashes.needed(first, stop)
        flashes.take(stop, numbers, TRUTH[numbers])
        ready.append(flashes.ready)
        assert strobe.times_s[: flashes.ready].max(initial=0) * rate_hz <= stop
    assert ready == sorted(ready) and ready[-1] == len(strobe.times_s)
    for index, time_s in enumerate(strobe.times_s):
        before = min(int(time_s * rate_hz), frames - 2)
        share = time_s * rate_hz - before
        assert flashes.shape_m(index) == pytest.approx(
            TRUTH[before] * (1 - share) + TRUTH[before + 1] * share, abs=1e-5
        )
    assert flashes.shape_m(flashes.ready) is None
