"""The safety limiter: never above its ceiling, never abrupt, never there where it is not needed."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.kernels.limiter import AHEAD, CEILING, STEEPEST
from engine.voices import Mixer, Voice, plain_program
from engine.voices.mixer import LIMITER_RELEASE_S
from tests.engine.sounds import RATE_HZ, mixer_of, voice_of
from tests.engine.sounds import Samples as Sound

ROUNDING = 1e-6  # of a gain that is read off single-precision samples


def limited(sound: Sound, block: int = 1000) -> Sound:
    """As a device is given it, without the delay."""
    mixer, total = mixer_of(voice_of(sound), limited=True), len(sound) + AHEAD
    blocks = [mixer.render(min(block, total - first)) for first in range(0, total, block)]
    return np.concatenate(blocks)[AHEAD:]


def noise(seed: int = 0) -> Sound:
    """Half a second that swells and fades, up to +12 dB."""
    level = 4 * np.sin(np.linspace(0, np.pi, RATE_HZ // 2)) ** 2
    return (np.random.default_rng(seed).uniform(-1, 1, (RATE_HZ // 2, 2)) * level[:, np.newaxis]).astype(np.float32)


def burst(begin: int) -> Sound:
    """0.9, and for 200 frames twenty times as much, at once."""
    sound = np.full((RATE_HZ, 2), 0.9, np.float32)
    sound[begin : begin + 200] *= 20
    sound[::2] *= -1
    return sound


def tone(level: float) -> Sound:
    wave = level * np.sin(2 * np.pi * 220 * np.arange(RATE_HZ // 2) / RATE_HZ)
    return np.column_stack([wave, 0.5 * wave]).astype(np.float32)


LOUD = {
    "noise": noise(),
    "tone": tone(3.0),
    # wherever in a quantum the peak is; the first frames had no frame before them to fall in
    **{f"burst in frame {frame}": burst(64 * 100 + frame) for frame in (0, 1, 31, 32, 63)},
}


def gain_of(found: Sound, sound: Sound) -> NDArray[np.float64]:
    """Its factor, frame by frame, where it is loud enough to tell."""
    rows = np.arange(len(sound))
    side = np.abs(sound).argmax(axis=1)
    given = sound.astype(float)[rows, side]
    return np.where(np.abs(given) > 0.1, found[rows, side] / np.where(given == 0, 1.0, given), np.nan)


@pytest.mark.parametrize("name", LOUD)
def test_nothing_exceeds_the_ceiling_and_the_gain_has_neither_jumps_nor_corners(name: str) -> None:
    """Its slope changes by a small part of itself from frame to frame, down to the peak and up again."""
    found = limited(LOUD[name])
    assert np.abs(found).max() <= np.float32(CEILING)
    gain = gain_of(found, LOUD[name])
    reduction = 1 - np.nanmin(gain)
    assert np.nanmax(np.abs(np.diff(gain))) <= reduction * STEEPEST + ROUNDING
    if name.startswith("burst"):
        assert np.abs(np.diff(gain, 2)).max() <= reduction * STEEPEST**2 + 3 * ROUNDING


def test_it_begins_no_earlier_than_it_looks_and_the_gain_returns() -> None:
    begin = 6400
    sound = burst(begin)
    found = limited(sound)
    np.testing.assert_array_equal(found[: begin - AHEAD], sound[: begin - AHEAD])
    np.testing.assert_array_equal(found[-2000:], sound[-2000:])
    gain = gain_of(found, sound)
    np.testing.assert_allclose(gain[begin : begin + 200], CEILING / 18.0, rtol=1e-5)
    after = gain[begin + 200 + AHEAD : begin + 200 + 8 * AHEAD]
    growth = np.exp(1 / (LIMITER_RELEASE_S * RATE_HZ))
    np.testing.assert_allclose(after[1:] / after[:-1], growth, rtol=1e-5)
    assert (np.diff(gain[begin + 200 :]) > -ROUNDING).all()


def test_both_sides_have_one_gain() -> None:
    """So the image does not move."""
    sound = tone(3.0)
    found = limited(sound)
    loud = np.abs(sound[:, 1]) > 0.1
    ratio = found.astype(float)[loud] / sound[loud]
    np.testing.assert_allclose(ratio[:, 0], ratio[:, 1], rtol=1e-5)


@pytest.mark.parametrize("block", [1, 63, 64, 480])
def test_blocks_make_no_difference(block: int) -> None:
    sound = LOUD["noise"][:6000]
    np.testing.assert_array_equal(limited(sound, block), limited(sound, len(sound) + AHEAD))


def test_what_it_did_is_reported() -> None:
    voice = Voice.of_samples(plain_program(RATE_HZ), burst(6400))
    mixer = Mixer(RATE_HZ)
    mixer.add(voice)
    mixer.render(6000)
    assert mixer.take_reduction_db() == 0.0
    mixer.render(6000)
    assert mixer.take_reduction_db() == pytest.approx(20 * np.log10(18.0 / CEILING), abs=1e-5)
    assert mixer.take_peak() == pytest.approx(CEILING)


def test_after_a_loud_sound_soft_ones_are_as_they_were() -> None:
    """To the last bit: no average is left that lacks a rounding error of being 1."""
    sound = np.concatenate([burst(600)[:4000], noise(1)[:2000], np.zeros((48_000, 2), np.float32), 0.2 * noise(2)])
    np.testing.assert_array_equal(limited(sound)[-RATE_HZ // 2 :], sound[-RATE_HZ // 2 :])
