"""A and B of one level, aligned, and below the limiter."""

from __future__ import annotations

import numpy as np
import pytest

from app.abx.sound import make_stimuli
from app.audio import Track
from app.audio.limiter import CEILING

RATE_HZ = 8000
TIME_S = np.arange(RATE_HZ) / RATE_HZ


def track_of(**sounds: np.ndarray) -> Track:
    track = Track(RATE_HZ, RATE_HZ, tuple(sounds))
    track.append(sounds)
    return track


def decay(hz: float, peak: float) -> np.ndarray:
    return peak * np.exp(-3 * TIME_S) * np.sin(2 * np.pi * hz * TIME_S)


def rms(samples: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(samples, dtype=np.float64))))


def test_levels_are_equal_and_gains_are_told() -> None:
    model, truth = decay(200, 0.4), decay(200, 0.1)
    made = make_stimuli(track_of(model=model, truth=truth), ("truth", "model"))
    a, b = (made.track.read(name, 0, RATE_HZ) for name in "AB")
    assert rms(a) == pytest.approx(rms(b), rel=1e-6)
    np.testing.assert_allclose(a, truth * 10 ** (made.gains_db[0] / 20), atol=1e-7)
    np.testing.assert_allclose(b, model * 10 ** (made.gains_db[1] / 20), atol=1e-7)
    assert made.gains_db == pytest.approx((0.0, -12.041), abs=1e-3)


@pytest.mark.parametrize("volume_db", [-20.0, 0.0, 12.0])
def test_two_overlapping_sounds_stay_below_the_limiter(volume_db: float) -> None:
    tracks = track_of(model=decay(200, 1.4), truth=decay(300, 0.9))
    made = make_stimuli(tracks, ("model", "truth"), volume_db)
    peaks = [np.abs(made.track.read(name, 0, RATE_HZ)).max() for name in "AB"]
    assert 2 * max(peaks) * 10 ** (volume_db / 20) <= CEILING * 1.000001
    assert max(made.gains_db) <= 0


def test_what_says_nothing_is_noticed() -> None:
    tracks = track_of(model=decay(200, 0.5), truth=decay(200, 0.5), other=decay(450, 0.5), near=decay(200.2, 0.5))
    same = make_stimuli(tracks, ("model", "truth"))
    assert (same.same, same.trivial) == (True, False)
    other = make_stimuli(tracks, ("model", "other"))
    assert (other.same, other.trivial) == (False, True)
    near = make_stimuli(tracks, ("model", "near"))
    assert (near.same, near.trivial) == (False, False)


def test_silence_and_unfinished_sound_are_refused() -> None:
    with pytest.raises(ValueError, match="Truth is silent"):
        make_stimuli(track_of(model=decay(200, 0.5), truth=np.zeros(RATE_HZ)), ("model", "truth"))
    growing = Track(RATE_HZ, RATE_HZ, ("model", "truth"))
    with pytest.raises(ValueError, match="still being rendered"):
        make_stimuli(growing, ("model", "truth"))
