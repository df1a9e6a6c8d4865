"""A and B of one level, aligned, and below the limiter."""

from __future__ import annotations

import numpy as np
import pytest

from app.analysis.abx.sound import END_S, make_stimuli
from app.analysis.abx.trials import Identity
from engine.kernels.limiter import CEILING

RATE_HZ = 8000
IDENTITIES: tuple[Identity, Identity] = ("A", "B")
TIME_S = np.arange(RATE_HZ) / RATE_HZ


def decay(hz: float, peak: float) -> np.ndarray:
    """(frames, 1)"""
    return peak * np.exp(-3 * TIME_S[:, None]) * np.sin(2 * np.pi * hz * TIME_S[:, None])


def rms(samples: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(samples, dtype=np.float64))))


def test_levels_are_equal_and_gains_are_reported() -> None:
    model, truth = decay(200, 0.4), decay(200, 0.1)
    made = make_stimuli({"model": truth, "truth": model}, RATE_HZ)
    a, b = (made.samples[name] for name in IDENTITIES)
    assert rms(a) == pytest.approx(rms(b), rel=1e-6)
    kept = RATE_HZ - round(END_S * RATE_HZ)  # before the fade at the end
    np.testing.assert_allclose(a[:kept], (truth * 10 ** (made.gains_db[0] / 20))[:kept], atol=1e-7)
    np.testing.assert_allclose(b[:kept], (model * 10 ** (made.gains_db[1] / 20))[:kept], atol=1e-7)
    assert made.gains_db == pytest.approx((0.0, -12.041), abs=1e-3)


@pytest.mark.parametrize("volume_db", [-20.0, 0.0, 12.0])
def test_two_overlapping_sounds_stay_below_the_limiter(volume_db: float) -> None:
    sounds = {"model": decay(200, 1.4), "truth": decay(300, 0.9)}
    made = make_stimuli(sounds, RATE_HZ, volume_db)
    peaks = [np.abs(made.samples[name]).max() for name in IDENTITIES]
    assert 2 * max(peaks) * 10 ** (volume_db / 20) <= CEILING * 1.000001
    assert max(made.gains_db) <= 0


def test_what_says_nothing_is_noticed() -> None:
    hertz = {"model": 200, "truth": 200, "other": 450, "near": 200.2}
    sounds = {source: decay(hz, 0.5) for source, hz in hertz.items()}
    same = make_stimuli(sounds, RATE_HZ)
    assert (same.same, same.trivial) == (True, False)
    other = make_stimuli({**sounds, "truth": sounds["other"]}, RATE_HZ)
    assert (other.same, other.trivial) == (False, True)
    near = make_stimuli({**sounds, "truth": sounds["near"]}, RATE_HZ)
    assert (near.same, near.trivial) == (False, False)


def test_silence_is_refused() -> None:
    for silence in (np.zeros((RATE_HZ, 1)), np.zeros((0, 1))):
        with pytest.raises(ValueError, match="Truth is silent"):
            make_stimuli({"model": decay(200, 0.5), "truth": silence}, RATE_HZ)


def test_a_turn_ends_in_silence_and_both_sides_stay() -> None:
    """They are looped; a stereo pair keeps its two points."""
    stereo = np.concatenate([decay(200, 0.5), 0.25 * decay(200, 0.5)], axis=1) + 0.1
    made = make_stimuli({"model": stereo, "truth": stereo[:, ::-1]}, RATE_HZ)
    for name in IDENTITIES:
        assert made.samples[name].shape == (RATE_HZ, 2)
        assert np.abs(made.samples[name][-1]).max() < 1e-3
        assert np.abs(made.samples[name][-round(0.01 * RATE_HZ)]).max() > 0.01
