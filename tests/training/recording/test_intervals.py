"""Intervals of partials, and their frequencies at rest, against the truth of solved strings and of statistics."""

import math

import numpy as np
import pytest

from tests.training.recording.synthetic import figures_at_rest, synthetic_note
from training.recording.fit import fit_note
from training.recording.glide import CENTS, Glide, rate_basis
from training.recording.intervals import at_rest, covariance, share_of_tension
from training.recording.note import note_of
from training.recording.numbering import number_note
from training.recording.physics import physics_of
from training.recording.refine import Pole, real_rows
from training.recording.report import partials_in

FIGURES = ("hz", "decay", "level_db")


def test_intervals_of_random_strings_hold_the_truth_and_are_narrow():
    """Strings with a body, noise and a second polarisation; `bench recordings --synthetic 200` is the whole of it."""
    held, widths = [], []
    for seed in (11, 3_002):
        made = synthetic_note(seed, seconds=1.6)
        note = note_of(made.samples, made.rate_hz)
        series = number_note(note)
        assert series is not None
        learned = fit_note(note, series, free=4)
        physics = physics_of(learned)
        assert abs(1200 * math.log2(physics.f0_hz / made.f0_hz)) < 3
        assert physics.stiffness == pytest.approx(made.stiffness, rel=0.1)
        reported = {each.number: each for each in partials_in(learned, physics)}
        loudest = max(each.level_db for each in made.partials)
        for truth in made.partials:
            if truth.level_db < loudest - 50:
                continue
            own = learned.spreads[truth.number]
            ends = [getattr(own, name) for name in FIGURES]
            inside = zip(ends, FIGURES, strict=True)
            held.append([low <= getattr(truth, name) <= high for (low, high), name in inside])
            widths.append([1200 * math.log2(own.hz[1] / own.hz[0]), math.log(own.decay[1] / own.decay[0])])
            assert reported[truth.number].level_db == pytest.approx(truth.level_db - loudest, abs=1.5)
    assert len(held) > 40 and np.mean(held, axis=0).min() > 0.85
    assert np.median(widths, axis=0)[0] < 4  # cents: not by being wide
    assert np.median(widths, axis=0)[1] < 0.3


def test_the_covariance_of_white_noise_is_that_of_least_squares():
    random = np.random.default_rng(0)
    columns = random.standard_normal((400, 3, 2)) @ np.array([1, 1j])
    draws = [covariance(columns, 0.1 * (random.standard_normal((400, 2)) @ np.array([1, 1j]))) for _ in range(60)]
    rows = real_rows(columns)
    expected = 0.01 * np.linalg.inv(rows.T @ rows)
    np.testing.assert_allclose(np.diag(np.mean(draws, axis=0)), np.diag(expected), rtol=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_figures_of_beating_poles_are_those_of_their_sound(seed):
    random = np.random.default_rng(seed)
    drawn = [(2 * math.pi * hz, random.uniform(2, 6), random.uniform(0.2, 1, 2)) for hz in (200.0, 200.7)]
    poles = [Pole(complex(-decay, omega), complex(*a)) for omega, decay, a in drawn]
    t = np.linspace(0, 5, 500_001)
    z, slope = (sum(p.a * p.s**power * np.exp(p.s * t) for p in poles) for power in (0, 1))
    energy, step = np.abs(z) ** 2, t[1]
    total = float(energy.sum()) * step
    found = figures_at_rest(poles)
    turned = float((slope * z.conj()).imag.sum()) * step / total
    assert found[0] == pytest.approx(turned / (2 * math.pi), rel=1e-6)
    assert found[1] == pytest.approx(0.5 * total / (float((t * energy).sum()) * step), rel=1e-3)
    assert found[2] == pytest.approx(10 * math.log10(total), abs=0.01)


def test_the_energy_gives_the_end_of_a_glide():
    """A slow glide that a fit took for a part of the frequency belongs to the rest again."""
    poles = {k: [Pole(complex(-k, 2 * math.pi * 100 * k), 1 / k**2 + 0j, k)] for k in range(1, 7)}
    t = np.linspace(0, 2.5, 500)
    truth, weight = 1e-2 * np.exp(-2 * t), np.exp(-t)  # as the first partial's energy, and its amplitude
    rows = rate_basis(t) * weight[:, None]
    shares, *_ = np.linalg.lstsq(rows, (truth - 2e-3) * weight, rcond=None)  # the rest 3.5 cents too high
    rests = at_rest(Glide(shares), poles)
    expected = -2e-3 / CENTS - 0.5 * share_of_tension(6)[0] * 1e-2 / CENTS
    assert rests[6].cents < 0.4 * expected  # nearer than without
    assert abs(rests[6].cents - expected) < 3 * rests[6].error
    assert rests[1].cents < rests[6].cents and rests[1].error > rests[6].error
    assert sum(share_of_tension(k)[0] for k in range(1, 100)) == pytest.approx(1, abs=0.02)


def test_a_pitch_that_rises_is_not_taken_for_a_law():
    """Nor is a partial that hardly decays taken for the end of a glide."""
    falls = {k: [Pole(complex(-k, 2 * math.pi * 100 * k), 1 / k**2 + 0j, k)] for k in range(1, 7)}
    rising = at_rest(Glide(np.array([-12.0, -7.0, -6.0]) * CENTS), falls)
    assert max(abs(each.cents) for each in rising.values()) < 4
    rings = {1: [Pole(complex(-0.05, 628.0), 1 + 0j, 1)]}
    assert at_rest(Glide(np.array([5.0, 5.0, 5.0]) * CENTS), rings)[1].cents == 0
