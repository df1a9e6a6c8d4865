"""Decays that a recording shows, and those that it does not."""

import math

import numpy as np
import pytest

from training.recording.glide import Glide
from training.recording.refine import Fit, Pole
from training.recording.slow import FALL, settle_slow
from training.recording.sweeps import Takes

RATE_HZ = 8_000


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
