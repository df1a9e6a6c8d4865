"""Loudness and peak of a sound in closed form against the sound itself, sample by sample."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from engine.effects import Body, Effects, Impulse
from engine.effects.body import curves_of
from engine.kernels import constants as of
from engine.kernels import loudness
from engine.kernels.constants import CURVES_HZ as RATE_HZ

Array = NDArray[np.float64]
NO_BODY = np.zeros(0)
DB = 20 / np.log(10)


def sound_of(omega: Array, sigma: Array, *heard: Array) -> Array:
    rows = np.zeros((of.SOUND_ROWS, len(omega)))
    rows[of.SOUND_OMEGA], rows[of.SOUND_SIGMA] = omega, sigma
    rows[of.SOUND_LEFT : of.SOUND_LEFT + len(heard)] = heard
    return rows.ravel()


def drawn(seed: int, modes: int = 30) -> tuple[Array, Array, Array]:
    """ω, σ and amplitudes of a string, 0.01 of full scale."""
    draw = np.random.default_rng(seed)
    partial = np.arange(1, modes + 1)
    omega = 2 * np.pi * draw.uniform(80, 400) * partial * np.sqrt(1 + 1e-4 * partial**2)
    return omega, draw.uniform(1, 8) + 1e-3 * omega / 50, 0.01 * draw.standard_normal(modes) / partial


def samples(omega: Array, sigma: Array, heard: Array, seconds: float, swings: bool = False) -> Array:
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    found = np.exp(np.multiply.outer(t, 1j * omega - sigma)) @ heard
    return np.asarray(found.imag if swings else found.real)


def measured_db(sound: Array) -> float:
    """K-weighted, over the first part."""
    sound = sound[: round(of.PART_S * RATE_HZ)]
    power = np.abs(np.fft.rfft(sound)) ** 2
    weights = loudness.k_weight(np.fft.rfftfreq(len(sound), 1 / RATE_HZ))
    return 10 * float(np.log10(2 * (power * weights).sum() / len(sound) ** 2))


@pytest.mark.parametrize("seed", range(5))
def test_the_gain_brings_a_sound_to_the_wanted_level(seed: int) -> None:
    omega, sigma, heard = drawn(seed)
    gain = loudness.gain(sound_of(omega, sigma, heard), len(omega), 1, NO_BODY, 0.0)
    assert measured_db(gain * samples(omega, sigma, heard, 0.5)) == pytest.approx(of.WANTED_DB, abs=0.2)
    both = loudness.gain(sound_of(omega, sigma, heard, heard), len(omega), 2, NO_BODY, 0.0)
    assert both == pytest.approx(gain)
    other = loudness.gain(sound_of(omega, sigma, heard, 0 * heard), len(omega), 2, NO_BODY, 0.0)
    assert DB * np.log(other / gain) == pytest.approx(3.01, abs=0.01)


@pytest.mark.parametrize("mix", [0.3, 1.0])
@pytest.mark.parametrize("name", ["guitar", "harp"])
def test_it_does_so_through_a_body(name: str, mix: float) -> None:
    """The level through the body is that of its steady state: an onset takes a body some hundredths of a second."""
    curves = curves_of(Body(name=name))
    impulse = Effects(Body(mix, name=name)).impulse(RATE_HZ)
    off = []
    for seed in range(8):
        omega, sigma, heard = drawn(seed)
        gain = loudness.gain(sound_of(omega, sigma, heard), len(omega), 1, curves, mix)
        dry = gain * samples(omega, sigma, heard, 0.5)
        through = fftconvolve(dry[:, None], impulse, axes=0)[: len(dry)].T
        off.append(10 * np.log10(np.mean([10 ** (measured_db(side) / 10) for side in through])) - of.WANTED_DB)
    assert np.abs(off).max() < 1.5
    assert np.abs(np.mean(off)) < 0.5


@pytest.mark.parametrize("swings", [False, True])
@pytest.mark.parametrize(("mix", "off_db", "mean_db"), [(0.0, 1.5, 1.0), (0.8, 4.0, 2.0)])
def test_the_peak_is_nearly_the_highest_sample(mix: float, off_db: float, mean_db: float, swings: bool) -> None:
    """It is looked for in the first period alone; through a body it is an estimate."""
    curves = curves_of(Body(name="guitar")) if mix else NO_BODY
    impulse = Effects(Body(mix)).impulse(RATE_HZ) if mix else np.ones((1, 1))
    off = []
    for seed in range(8):
        omega, sigma, heard = drawn(seed)
        dry = samples(omega, sigma, heard, 0.1, swings)
        highest = np.abs(fftconvolve(dry[:, None], impulse, axes=0)[: len(dry), 0]).max()
        rows = sound_of(omega, sigma, heard)
        found = loudness.peak(rows, len(omega), swings, curves, mix, 0.0)
        off.append(DB * np.log(found / highest))
        assert found <= loudness.peak(rows, len(omega), swings, curves, mix, 10 * found) <= 10 * found
    assert abs(np.mean(off)) < mean_db
    assert np.abs(off).max() < off_db


def test_silence_has_a_gain_of_one_and_gains_and_peaks_have_bounds() -> None:
    omega, sigma, heard = drawn(0)
    assert loudness.gain(sound_of(omega, sigma, 0 * heard), len(omega), 1, NO_BODY, 0.0) == 1.0
    for factor, gain_db in ((1e-9, of.GAIN_RANGE_DB[1]), (1e9, of.GAIN_RANGE_DB[0])):
        found = loudness.gain(sound_of(omega, sigma, factor * heard), len(omega), 1, NO_BODY, 0.0)
        assert DB * np.log(found) == pytest.approx(gain_db)
    highest = 10 ** (of.HIGHEST_PEAK_DB / 20)
    assert loudness.limit(0.9 * highest) == 1.0
    assert 3 * highest * loudness.limit(3 * highest) == pytest.approx(highest)
    assert [loudness.looked_at(28, 88, number) for number in range(loudness.LOOKED_AT)] == [28, 43, 58, 73, 88]


def test_a_body_on_one_side_is_levelled_as_its_mirror_image() -> None:
    samples = np.random.default_rng(0).uniform(-1, 1, (2_000, 1)) * np.geomspace(1, 1e-3, 2_000)[:, None]
    sides = (np.hstack([samples, 0 * samples]), np.hstack([0 * samples, samples]))
    left, right = (curves_of(Body(impulse=Impulse(side, 48_000))) for side in sides)
    np.testing.assert_allclose(left, right, rtol=1e-9, atol=1e-12)
    assert left[of.BODY_STEP] > 0.1
