"""Decay by mode: against the formulas' own limits, and the compiled strings."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from engine.resonators.losses import loss_rates
from engine.resonators.string import undamped_frequencies
from engine.values.string import Losses, StringParameters

STEEL = StringParameters(0.65, 5e-7, 2e-14, 7850.0, 2e11, 0.0, 0.0, 75.0)


def test_friction_alone_gives_all_partials_one_quality() -> None:
    flexible = replace(STEEL, youngs_modulus_pa=0.0)
    sigma = loss_rates(Losses(0.0, 1e-3, 0.5), flexible, 20)
    np.testing.assert_allclose(2 * sigma / undamped_frequencies(flexible, 20), 1e-3)


def test_stiff_partials_have_the_loss_factor_of_bending() -> None:
    stiff = replace(STEEL, second_moment_m4=1e-7)
    sigma = loss_rates(Losses(0.0, 0.0, 0.01), stiff, 40)
    assert float(2 * sigma[-1] / undamped_frequencies(stiff, 40)[-1]) == pytest.approx(0.01, rel=0.01)


def test_air_takes_a_tenth_of_a_millimetre_of_steel_a_thousandth() -> None:
    """By hand: 2R = 0.2 mm at 440 Hz, ρA = 2.47e-4 kg/m: σ = π (ν + d √(π ν ρ f)) / ρA."""
    thin = replace(STEEL, area_m2=math.pi * 1e-8)
    thin = replace(thin, tension_n=(2 * 440 * thin.length_m) ** 2 * thin.mass_per_length_kg_m, youngs_modulus_pa=0.0)
    by_hand = math.pi * (1.8e-5 + 2e-4 * math.sqrt(math.pi * 1.8e-5 * 1.2 * 440)) / 2.4662e-4
    assert float(loss_rates(Losses(1.0, 0.0, 0.0), thin, 1)[0]) == pytest.approx(by_hand, rel=1e-3)


def test_impossible_losses_are_refused() -> None:
    with pytest.raises(ValueError, match="friction must lie in 0"):
        Losses(friction=-1.0)
