"""The refinement of a note's poles and glide."""

from __future__ import annotations

import math

import numpy as np

from training.recording.glide import Glide
from training.recording.refine import MOST_GLIDE, Fit, Pole

RATE_HZ = 44_100


def test_a_short_note_with_the_largest_glide_is_refined() -> None:
    """Time that is stretched by it ends with the spectrum."""
    time_s = np.arange(RATE_HZ // 2) / RATE_HZ
    sound = np.exp(-3 * time_s) * np.cos(2 * math.pi * 100 * time_s)
    poles = [[Pole(complex(-3, 2 * math.pi * 100), 1 + 0j, 1)]]
    glide = Glide(np.full(3, MOST_GLIDE[1]))
    fit = Fit(sound, RATE_HZ, np.array([50.0, 150.0]), np.array([100.0]), glide, poles)
    assert fit.count <= fit.size
    assert np.isfinite(fit.step_glide().shares).all()
