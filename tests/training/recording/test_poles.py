"""Poles and glides against closed forms, spectra by an FFT and finite differences; decays that do not show."""

import math

import numpy as np
import pytest

from training.recording.glide import CENTS, Glide, basis, glide_of_phases, rate_basis, warped
from training.recording.refine import MOST_GLIDE, Fit, Pole, polarisations, subspace_poles
from training.recording.slow import FALL, settle_slow
from training.recording.sweeps import Takes

RATE_HZ = 8_000
GLIDING = Pole(complex(-4, 2 * math.pi * 103), 0.3 + 0.2j, 1)
FREE = Pole(complex(-20, 2 * math.pi * 180), 0.3 - 0.2j, 0)


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_a_subspace_has_the_poles_of_exponentials(count, seed):
    random = np.random.default_rng(seed)
    turns = np.linspace(-2.5, 2.5, count) + random.uniform(-0.3, 0.3, count)
    z = np.exp(-random.uniform(1e-3, 5e-2, count) + 1j * turns)
    envelope = np.exp(2j * math.pi * random.uniform(size=count)) @ z[:, None] ** np.arange(200)
    found = subspace_poles(envelope, count)
    np.testing.assert_allclose(found[np.argsort(np.angle(found))], z, atol=1e-8)
    assert len(subspace_poles(envelope[: 2 * count], count)) == 0


@pytest.fixture(scope="module")
def fit() -> Fit:
    """Two bands of a note that glides."""
    noise = np.random.default_rng(0).standard_normal(4_000)
    glide = Glide(np.array([5, -3, 4]) * CENTS)
    return Fit(noise, RATE_HZ, np.array([50.0, 150, 250]), np.array([100.0, 200]), glide)


@pytest.mark.parametrize(("pole", "most"), [(GLIDING, 1e-10), (FREE, 2e-2)])
def test_the_spectrum_of_a_pole_is_its_sounds_and_its_columns_are_the_slopes(fit, pole, most):
    """In closed form; of poles that do not glide by a sum over some samples."""
    bins = slice(1, fit.highest)
    index = np.arange(bins.start, bins.stop)
    time_s = np.arange(fit.count) / RATE_HZ if pole.partial else fit.times
    for power, found in enumerate(fit.spectra(pole, bins)):
        whole = np.fft.fft(time_s**power * np.exp(pole.s * time_s), fit.size)
        scale = np.abs(whole).max()
        np.testing.assert_allclose(found[0], whole[index], atol=most * scale)
        np.testing.assert_allclose(found[1], whole[-index].conj(), atol=most * scale)

    linear, bent = fit.columns([pole], bins)
    present = fit.part([pole], bins)
    np.testing.assert_allclose(linear @ [pole.a.real, pole.a.imag], present, atol=1e-9)
    for column, (change, step) in enumerate(((1e-6 * pole.s.real, 1e-6), (1e-4j, 1e-4))):  # of log σ, and of ω
        slope = (fit.part([Pole(pole.s + change, pole.a, pole.partial)], bins) - present) / step
        np.testing.assert_allclose(bent[:, column], slope, atol=1e-3 * np.abs(slope).max())


def test_of_a_partials_poles_two_are_its_polarisations_the_lower_one_first():
    def pole(cents: float, decay: float, amplitude: float) -> Pole:
        return Pole(complex(-decay, 2 * math.pi * 200 * 2 ** (cents / 1200)), complex(amplitude), 1)

    main, above, below = pole(0, 2, 1), pole(5, 3, 0.5), pole(-5, 1, 0.1)
    far, body = pole(40, 2, 0.9), pole(3, 50, 0.9)
    assert polarisations([]) == []
    assert polarisations([far, main, body]) == [main]
    assert polarisations([above, body, main]) == [main, above]
    assert polarisations([main, below, above]) == [main, above]  # the louder of two
    assert polarisations([main, below, far]) == [below, main]


def test_a_short_note_with_the_largest_glide_is_refined():
    """Time that is stretched by it ends with the spectrum."""
    time_s = np.arange(22_050) / 44_100
    sound = np.exp(-3 * time_s) * np.cos(2 * math.pi * 100 * time_s)
    poles = [[Pole(complex(-3, 2 * math.pi * 100), 1 + 0j, 1)]]
    fit = Fit(sound, 44_100, np.array([50.0, 150.0]), np.array([100.0]), Glide(np.full(3, MOST_GLIDE[1])), poles)
    assert fit.count <= fit.size
    assert np.isfinite(fit.step_glide().shares).all()


def pole_of(decay: float, hz: float, amplitude: float) -> Pole:
    return Pole(complex(-decay, 2 * math.pi * hz), complex(amplitude), 1)


def fit_of(pole: Pole, seconds: float, *others: Pole) -> Fit:
    """A fit of the sound of one pole, which has others too."""
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    sound = (pole.a * np.exp(pole.s * t)).real + 1e-3 * np.random.default_rng(0).standard_normal(len(t))
    return Fit(sound, RATE_HZ, np.array([50.0, 150.0]), np.array([100.0]), Glide.none(), [[pole, *others]])


def test_a_decay_that_shows_stays_and_one_that_does_not_is_settled_alike_in_all_takes():
    shows = fit_of(pole_of(0.2, 100.0, 0.5), 2.5)
    settle_slow(Takes([shows]))
    assert shows.poles[0][0].decay == pytest.approx(0.2, rel=0.02)
    beside = pole_of(0.05, 100.3, 1e-3)
    alone, *takes = (fit_of(pole_of(6.0, 100.0, amplitude), 0.5, beside) for amplitude in (0.5, 0.5, 0.2))
    settle_slow(Takes([alone]))
    assert alone.poles[0][0].decay == 6.0
    assert 0.5 < alone.poles[0][1].decay <= FALL / 0.5
    settle_slow(Takes(takes))
    assert [pole.s for pole in takes[0].poles[0]] == [pole.s for pole in takes[1].poles[0]]


TIMES = np.linspace(0, 2, 400)


def glide_of(seed: int, pitch: float = 0.0) -> Glide:
    return Glide(np.random.default_rng(seed).uniform(-5, 15, 3) * CENTS, pitch)


@pytest.mark.parametrize("seed", range(4))
def test_warped_time_runs_as_fast_as_the_pitch_is_high_and_phases_of_partials_show_the_glide(seed):
    one = glide_of(seed, pitch=2e-3)
    np.testing.assert_allclose(one.times(one.tau(TIMES)), TIMES, atol=1e-12)
    slope = (one.tau(TIMES + 1e-6) - one.tau(TIMES - 1e-6)) / 2e-6
    np.testing.assert_allclose(slope, 1 + one.pitch + rate_basis(TIMES) @ one.shares, rtol=1e-8)
    np.testing.assert_allclose(
        2 ** (glide_of(seed).cents(TIMES) / 1200), 1 + rate_basis(TIMES) @ one.shares, rtol=1e-12
    )
    assert not Glide.none().cents(TIMES).any()

    one = glide_of(seed)  # a tone that glides so does not in warped time
    t = np.arange(RATE_HZ) / RATE_HZ
    found, times = warped(np.sin(2 * math.pi * 440 * one.tau(t)), RATE_HZ, one)
    still = np.sin(2 * math.pi * 440 * np.arange(len(found)) / RATE_HZ)
    np.testing.assert_allclose(found[:-100], still[:-100], atol=1e-5)
    np.testing.assert_allclose(one.tau(times[:-100]), np.arange(len(found) - 100) / RATE_HZ, atol=1e-9)

    random = np.random.default_rng([seed, 1])  # phases show it: each partial is off its place by some cents
    t, bands = np.arange(150) / 120, []
    for k in range(1, 9):
        off_hz, hz = random.uniform(-0.2, 0.2), 100.0 * k
        phase = 2 * math.pi * (hz * (basis(t) @ one.shares) + off_hz * t + random.uniform())
        bands.append((hz, 1 / 120, np.exp(-3 * t + 1j * phase) / k + 1e-4 * random.standard_normal(len(t))))
    apart = (glide_of_phases(bands).cents(TIMES) - one.cents(TIMES))[TIMES < 1]
    assert float(np.abs(apart - apart.mean()).max()) < 0.1 * float(np.ptp(one.cents(TIMES)))
