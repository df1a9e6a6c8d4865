"""Two sounds side by side: looped, in step, switched without a click."""

from __future__ import annotations

import numpy as np
import pytest

from app.playing.pair import Pair
from engine.voices import Mixer

RATE_HZ, FRAMES = 48_000, 4_800
TIME_S = np.arange(FRAMES) / RATE_HZ


@pytest.fixture
def mixer() -> Mixer:
    return Mixer(RATE_HZ, limited=False)


@pytest.fixture
def pair(mixer: Mixer) -> Pair:
    """Whole periods of 100 and 200 Hz."""
    waves = {name: 0.2 * np.sin(2 * np.pi * hz * TIME_S)[:, None] for name, hz in (("A", 100), ("B", 200))}
    made = Pair(mixer, {name: wave.astype(np.float32) for name, wave in waves.items()})
    made.select("A")
    return made


def wave(hz: float, first: int, frames: int) -> np.ndarray:
    return 0.2 * np.sin(2 * np.pi * hz * (first + np.arange(frames)) / RATE_HZ)


def test_what_is_selected_is_heard_again_and_again(mixer: Mixer, pair: Pair) -> None:
    pair.play()
    out = mixer.render(3 * FRAMES)
    np.testing.assert_allclose(out[200:, 0], wave(100, 200, 3 * FRAMES - 200), atol=1e-6)
    np.testing.assert_array_equal(out[:, 0], out[:, 1])


def test_a_switch_is_a_cross_fade_in_step(mixer: Mixer, pair: Pair) -> None:
    pair.play()
    mixer.render(1_920)
    pair.select("B")
    pair.play()  # continues
    out = mixer.render(FRAMES)[:, 0]
    np.testing.assert_allclose(out[2_000:], wave(200, 3_920, FRAMES - 2_000), atol=1e-6)
    steepest = 0.2 * 2 * np.pi * 200 / RATE_HZ
    assert np.abs(np.diff(out)).max() < 1.3 * steepest
    assert len(mixer.voices) == 2


def test_again_it_begins_at_its_start_and_what_rang_fades(mixer: Mixer, pair: Pair) -> None:
    pair.play()
    mixer.render(1_920)
    pair.play(restart=True)
    assert len(mixer.voices) == 4
    mixer.render(1_920)
    assert len(mixer.voices) == 2
    np.testing.assert_allclose(mixer.render(640)[:, 0], wave(100, 1_920, 640), atol=1e-6)


def test_it_stops_and_plays_again(mixer: Mixer, pair: Pair) -> None:
    pair.stop()  # nothing sounds
    pair.play()
    mixer.render(640)
    pair.stop()
    mixer.render(1_920)
    assert not mixer.render(640).any()
    assert mixer.voices == []
    pair.select("B")
    pair.play()
    np.testing.assert_allclose(mixer.render(1_280)[200:, 0], wave(200, 200, 1_080), atol=1e-6)
