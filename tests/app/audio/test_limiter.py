"""The limiter keeps to its ceiling and leaves everything below alone."""

import numpy as np
import pytest
from app.audio.limiter import CEILING, RELEASE_S, Limiter

RATE_HZ = 48_000


def sine(peak: float, seconds: float = 0.5) -> np.ndarray:
    return peak * np.sin(2 * np.pi * 220 * np.arange(round(seconds * RATE_HZ)) / RATE_HZ)


@pytest.mark.parametrize("peak", [1.0, 3.0, 1e3, 1e30])
def test_nothing_passes_the_ceiling(peak: float) -> None:
    limiter = Limiter(RATE_HZ)
    out = limiter.process(sine(peak))
    assert np.abs(out).max() <= CEILING
    assert limiter.gain_reduction_db > 0


def test_a_quiet_signal_passes_bit_for_bit() -> None:
    limiter = Limiter(RATE_HZ)
    quiet = sine(0.96)
    np.testing.assert_array_equal(limiter.process(quiet), quiet)
    assert limiter.gain_reduction_db == 0


def test_the_gain_recovers_after_a_peak() -> None:
    limiter = Limiter(RATE_HZ)
    click = np.full(round(0.5 * RATE_HZ), 0.1)
    click[0] = 2.0
    out = limiter.process(click)
    reduced_db = 20 * np.log10(out / 0.1)
    after_one_release = round(RELEASE_S * RATE_HZ / 2)
    assert reduced_db[1] == pytest.approx(20 * np.log10(CEILING / 2), abs=0.1)
    assert reduced_db[after_one_release] == pytest.approx(reduced_db[1] + 10 * np.log10(np.e), abs=0.1)
    assert reduced_db[-1] == 0


def test_a_runaway_sample_does_not_mute_for_long() -> None:
    burst = np.full(RATE_HZ, 0.1)
    burst[0] = 1e30
    out = Limiter(RATE_HZ).process(burst)
    np.testing.assert_array_equal(out[RATE_HZ // 2 :], 0.1)


@pytest.mark.parametrize("block_frames", [1, 64, 65, 8193])
def test_any_splitting_gives_the_same(block_frames: int) -> None:
    loud = sine(1.5, 0.2)
    loud *= np.linspace(1, 0.3, loud.size)
    whole = Limiter(RATE_HZ).process(loud)
    limiter = Limiter(RATE_HZ)
    parts = [limiter.process(loud[k : k + block_frames]) for k in range(0, loud.size, block_frames)]
    np.testing.assert_allclose(np.concatenate(parts), whole, atol=1e-12)
