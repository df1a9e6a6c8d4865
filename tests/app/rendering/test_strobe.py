"""Slow motion: which moments are shown, and the string at them."""

from __future__ import annotations

import numpy as np
import pytest

from app.rendering.strobe import FLASH_HZ, Flashes, Strobe

HZ = 247.0


def test_slow_motion_stays_within_a_period_of_the_playhead_and_moves_slowly() -> None:
    strobe = Strobe(0.004, HZ, 4.0)
    places_s = np.arange(len(strobe.times_s)) / FLASH_HZ
    assert np.abs(strobe.times_s - places_s).max() <= 1 / HZ
    turns = np.diff(np.unwrap(2 * np.pi * (strobe.times_s[:-1] * HZ % 1.0))) / (2 * np.pi)
    assert turns == pytest.approx(np.full(len(turns), 0.004 * HZ / FLASH_HZ), abs=1e-6)


def test_real_time_shows_the_playhead_itself() -> None:
    strobe = Strobe(1.0, HZ, 1.0)
    assert strobe.times_s == pytest.approx(np.arange(FLASH_HZ + 1) / FLASH_HZ)


def test_a_place_has_the_last_flash_up_to_it() -> None:
    strobe = Strobe(0.004, HZ, 1.0)
    places_s = (-1.0, 0.0, 1.4 / FLASH_HZ, 0.999, 1.0, 9.0)
    assert [strobe.flash(place_s) for place_s in places_s] == [0, 0, 1, FLASH_HZ - 1, FLASH_HZ, FLASH_HZ]


@pytest.mark.parametrize("block", [1, 7, 100, 5_000])
def test_flashes_lie_between_the_frames_around_them_however_they_come(block: int) -> None:
    rate_hz, frames = 1_000, 1_001
    motion_m = np.random.default_rng(0).standard_normal((frames, 3)).astype(np.float32)
    strobe = Strobe(0.01, HZ, 1.0)
    flashes = Flashes(strobe, rate_hz, frames, 3)
    ready = [flashes.ready]
    for first in range(0, frames, block):
        stop = min(first + block, frames)
        numbers = flashes.needed(first, stop)
        flashes.take(stop, numbers, motion_m[numbers])
        ready.append(flashes.ready)
        if flashes.ready:
            assert strobe.times_s[: flashes.ready].max() * rate_hz <= stop
    assert ready == sorted(ready)
    assert flashes.ready == len(strobe.times_s)
    for index, time_s in enumerate(strobe.times_s):
        before = min(int(time_s * rate_hz), frames - 2)
        share = time_s * rate_hz - before
        expected = motion_m[before] * (1 - share) + motion_m[before + 1] * share
        assert flashes.shape_m(index) == pytest.approx(expected, abs=1e-5)
    assert flashes.shape_m(flashes.ready) is None
