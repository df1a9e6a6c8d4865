"""The glide against its definition, and found in the phases of partials."""

import math

import numpy as np
import pytest

from training.recording.glide import CENTS, Glide, basis, glide_of_phases, rate_basis, warped

SEEDS = range(4)
T = np.linspace(0, 2, 400)


def glide(seed: int, pitch: float = 0.0) -> Glide:
    return Glide(np.random.default_rng(seed).uniform(-5, 15, 3) * CENTS, pitch)


@pytest.mark.parametrize("seed", SEEDS)
def test_warped_time_runs_as_fast_as_the_pitch_is_high_and_back_again(seed):
    one = glide(seed, pitch=2e-3)
    np.testing.assert_allclose(one.times(one.tau(T)), T, atol=1e-12)
    slope = (one.tau(T + 1e-6) - one.tau(T - 1e-6)) / 2e-6
    np.testing.assert_allclose(slope, 1 + one.pitch + rate_basis(T) @ one.shares, rtol=1e-8)
    np.testing.assert_allclose(2 ** (glide(seed).cents(T) / 1200), 1 + rate_basis(T) @ one.shares, rtol=1e-12)
    assert not Glide.none().cents(T).any()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_gliding_tone_does_not_glide_in_warped_time(seed):
    one, rate_hz = glide(seed), 8_000
    t = np.arange(rate_hz) / rate_hz
    found, times = warped(np.sin(2 * math.pi * 440 * one.tau(t)), rate_hz, one)
    still = np.sin(2 * math.pi * 440 * np.arange(len(found)) / rate_hz)
    np.testing.assert_allclose(found[:-100], still[:-100], atol=1e-5)
    np.testing.assert_allclose(one.tau(times[:-100]), np.arange(len(found) - 100) / rate_hz, atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_phases_of_partials_show_the_glide_that_they_share(seed):
    """Up to what is constant: each partial is off its place in the series by some cents."""
    one, random = glide(seed), np.random.default_rng([seed, 1])
    t, bands = np.arange(150) / 120, []
    for k in range(1, 9):
        off_hz, hz = random.uniform(-0.2, 0.2), 100.0 * k
        phase = 2 * math.pi * (hz * (basis(t) @ one.shares) + off_hz * t + random.uniform())
        bands.append((hz, 1 / 120, np.exp(-3 * t + 1j * phase) / k + 1e-4 * random.standard_normal(len(t))))
    apart = (glide_of_phases(bands).cents(T) - one.cents(T))[T < 1]
    assert float(np.abs(apart - apart.mean()).max()) < 0.1 * float(np.ptp(one.cents(T)))
