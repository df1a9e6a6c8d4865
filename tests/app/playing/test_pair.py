"""Two sounds side by side: looped, in step, switched without a click."""

import numpy as np

from app.playing.pair import Pair
from engine.voices import Mixer

RATE_HZ, FRAMES = 48_000, 4_800


def test_what_is_selected_is_heard_again_and_again_and_switched_by_a_cross_fade_in_step():
    mixer, pair = made()
    pair.stop()  # nothing sounds
    pair.play()
    out = mixer.render(3 * FRAMES)
    np.testing.assert_allclose(out[200:, 0], wave(100, 200, 3 * FRAMES - 200), atol=1e-6)
    np.testing.assert_array_equal(out[:, 0], out[:, 1])
    pair.select("B")
    pair.play()  # continues
    faded = mixer.render(FRAMES)[:, 0]
    np.testing.assert_allclose(faded[2_000:], wave(200, 2_000, FRAMES - 2_000), atol=1e-6)
    assert np.abs(np.diff(faded)).max() < 1.3 * 0.2 * 2 * np.pi * 200 / RATE_HZ and len(mixer.voices) == 2


def test_again_it_begins_at_its_start_and_what_rang_fades():
    mixer, pair = made()
    pair.play()
    mixer.render(1_920)
    pair.play(restart=True)
    assert len(mixer.voices) == 4
    mixer.render(1_920)
    assert len(mixer.voices) == 2
    np.testing.assert_allclose(mixer.render(640)[:, 0], wave(100, 1_920, 640), atol=1e-6)
    pair.stop()
    mixer.render(1_920)
    assert not mixer.render(640).any() and mixer.voices == []
    pair.select("B")
    pair.play()
    np.testing.assert_allclose(mixer.render(1_280)[200:, 0], wave(200, 200, 1_080), atol=1e-6)


def made() -> tuple[Mixer, Pair]:
    """Whole periods of 100 and 200 Hz."""
    waves = {name: wave(hz, 0, FRAMES)[:, None].astype(np.float32) for name, hz in (("A", 100), ("B", 200))}
    mixer = Mixer(RATE_HZ, limited=False)
    pair = Pair(mixer, waves)
    pair.select("A")
    return mixer, pair


def wave(hz: float, first: int, frames: int) -> np.ndarray:
    return 0.2 * np.sin(2 * np.pi * hz * (first + np.arange(frames)) / RATE_HZ)
