"""Spectral distances by hand."""

import math

import numpy as np
import pytest

from engine.compare.spectra import FLOOR_DB, log_spectral_distance, spectral_distances


def sine(hz: float, samples: int = 4000, phase: float = 0.0) -> np.ndarray:
    return np.sin(2 * math.pi * hz * np.arange(samples) / 4000 + phase)[None]


def test_a_gain_is_reported_exactly() -> None:
    noise = np.random.default_rng(0).standard_normal((3, 5000), np.float32)
    convergence, log_db = spectral_distances(2 * noise, noise)
    assert convergence.tolist() == pytest.approx([1, 1, 1])
    assert log_db.tolist() == pytest.approx([20 * math.log10(2)] * 3, rel=1e-3)
    assert [values.tolist() for values in spectral_distances(noise, noise)] == [[0, 0, 0], [0, 0, 0]]


def test_a_phase_is_not_heard_and_a_frequency_is() -> None:
    convergence, _ = spectral_distances(sine(500, phase=1), sine(500))
    assert float(convergence[0]) < 0.01
    convergence, log_db = spectral_distances(sine(700), sine(500))
    assert float(convergence[0]) == pytest.approx(2**0.5, rel=0.01)
    assert float(log_db[0]) > 1


@pytest.mark.parametrize("samples", [1, 2, 3, 100, 511, 600])
def test_short_sounds(samples: int) -> None:
    sound = 1 + sine(500, samples)
    assert float(spectral_distances(3 * sound, sound)[0][0]) == pytest.approx(2)


def test_silence_and_what_is_no_number() -> None:
    silence = np.zeros((1, 600))
    assert [float(value[0]) for value in spectral_distances(silence, silence)] == [0, 0]
    assert float(spectral_distances(sine(500, 600), silence)[0][0]) == math.inf
    quiet = 10 ** (FLOOR_DB / 20) / 10 * sine(1500)
    assert float(spectral_distances(sine(500) + quiet, sine(500))[1][0]) < 0.01  # below the floor
    for shapes, words in (((3, 4), "differ in shape"), ((0, 0), "at least one sample")):
        with pytest.raises(ValueError, match=words):
            spectral_distances(*(np.zeros((1, samples)) for samples in shapes))
    for value in (math.nan, math.inf):
        assert [float(v[0]) for v in spectral_distances(silence + value, sine(500, 600))] == [math.inf, math.inf]


def test_a_log_spectral_distance_is_a_gain_above_the_floor() -> None:
    noise = np.random.default_rng(0).standard_normal(5000)
    assert log_spectral_distance(noise, 2 * noise) == pytest.approx(20 * math.log10(2))
    assert log_spectral_distance(noise[:100], noise[:100] / 2) == pytest.approx(20 * math.log10(2), rel=0.05)
    assert log_spectral_distance(noise, 2 * noise, noise_power=1e6) == 0
    assert log_spectral_distance(0 * noise, 0 * noise) == 0
