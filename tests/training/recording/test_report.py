"""Errors and decays of the report, and distances of attacks, against sounds whose own are known."""

import math

import numpy as np
import pytest

from training.recording.report import bands_of, errors_of

RATE_HZ = 44_100
T60_S = {125.0: 1.5, 500.0: 1.0, 2_000.0: 0.6, 8_000.0: 0.3}
T = np.arange(2 * RATE_HZ) / RATE_HZ


def test_an_octave_decays_as_its_tone_and_one_that_is_noise_has_no_decay():
    tones = [np.exp(-math.log(1000) / t60 * T) * np.sin(2 * math.pi * hz * T) for hz, t60 in T60_S.items()]
    noise = 1e-4 * np.random.default_rng(0).standard_normal(len(T))
    found = {band.hz: band for band in bands_of(np.sum(tones, axis=0) + noise, 0.1 * tones[1], RATE_HZ, 1e-8)}
    assert {hz: found[hz].recorded_t60_s for hz in T60_S} == pytest.approx(T60_S, rel=0.02)
    assert found[500.0].learned_t60_s == pytest.approx(T60_S[500.0], rel=0.02)
    assert bands_of(noise, noise, RATE_HZ, 1e-8) == ()


@pytest.mark.parametrize("frames", [-30.0, 0.0, 20.5])
def test_errors_ignore_one_gain_and_one_delay_and_nothing_else(frames):
    def sound(shift: float) -> np.ndarray:
        t = T[:30_000] - shift / RATE_HZ
        return np.exp(-3 * t) * np.sin(2 * math.pi * 200 * t) * (1 - np.exp(-200 * np.maximum(t, 0)))

    truth = sound(40.0)
    errors = errors_of(truth, 0.5 * sound(40.0 + frames), RATE_HZ)
    assert errors.esr < 1e-3 and errors.log_spectral_distance_db < 1
    assert errors.delay_s == pytest.approx(-frames / RATE_HZ, abs=2e-6)
    assert errors.gain_db == pytest.approx(20 * math.log10(2), abs=0.05)
    noise = 0.1 * float(np.std(truth)) * np.random.default_rng(0).standard_normal(len(truth))
    assert errors_of(truth, truth + noise, RATE_HZ).esr == pytest.approx(0.01, rel=0.1)
    assert errors_of(truth, truth, RATE_HZ).log_spectral_distance_db == 0
