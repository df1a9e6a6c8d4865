"""Decays that a recording shows, and those that it does not."""

import math
from dataclasses import replace

import numpy as np
import pytest

from training.recording.glide import Glide
from training.recording.refine import Fit, Pole
from training.recording.slow import FALL, settle_slow
from training.recording.sweeps import Takes

RATE_HZ = 8_000


def fit_of(poles: list[Pole], seconds: float) -> Fit:
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    sound = sum((pole.a * np.exp(pole.s * t)).real for pole in poles) + np.zeros(len(t))
    sound += 1e-3 * np.random.default_rng(0).standard_normal(len(t))
    return Fit(sound, RATE_HZ, np.array([50.0, 150.0]), np.array([100.0]), Glide.none(), [list(poles)])


def pole_of(decay: float, hz: float, amplitude: float) -> Pole:
    return Pole(complex(-decay, 2 * math.pi * hz), complex(amplitude), 1)


def test_a_decay_that_shows_stays():
    fit = fit_of([pole_of(0.2, 100.0, 0.5)], 2.5)
    settle_slow(Takes([fit]))
    assert fit.poles[0][0].decay == pytest.approx(0.2, rel=0.02)


def test_a_decay_that_does_not_show_is_settled():
    loud, beside = pole_of(6.0, 100.0, 0.5), pole_of(0.05, 100.3, 1e-3)
    fit = fit_of([loud], 0.5)
    fit.poles[0] = [loud, beside]
    settle_slow(Takes([fit]))
    assert fit.poles[0][0].decay == 6.0
    assert 0.5 < fit.poles[0][1].decay <= FALL / 0.5


def test_takes_settle_alike():
    loud, beside = pole_of(6.0, 100.0, 0.5), pole_of(0.05, 100.3, 1e-3)
    fits = [fit_of([loud], 0.5), fit_of([replace(loud, a=0.2 + 0j)], 0.5)]
    for fit in fits:
        fit.poles[0] = [loud, beside]
    settle_slow(Takes(fits))
    assert [pole.s for pole in fits[0].poles[0]] == [pole.s for pole in fits[1].poles[0]]
