"""The slow flow against the truth: closed forms where the string is quiet, the splitting solver where not."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from engine.excitation import gaussian
from engine.resonators.base import Resonator
from engine.resonators.string import StringParameters
from engine.truth import ModalState, SplittingSolver, solve_linear
from training.research.slow_flow import slow_flow

RATE_HZ = 48_000.0
STEEL_E4 = StringParameters(0.648, 5.0671e-08, 2.0432e-16, 7850.0, 220e9, 8e-6, 1.4e-6, 72.2016)


def string(inharmonicity: float = 1.5e-5) -> StringParameters:
    second_moment = inharmonicity * STEEL_E4.tension_n * STEEL_E4.length_m**2
    return replace(STEEL_E4, second_moment_m4=second_moment / (STEEL_E4.youngs_modulus_pa * math.pi**2))


def pluck(resonator: Resonator, rise: float) -> Tensor:
    """Modal amplitudes of a pluck that raises the tension by a share `rise`."""
    amplitudes = resonator.to_modes(gaussian(0.3, 0.1, 1e-3, 101))
    return torch.from_numpy(amplitudes * math.sqrt(rise / float(resonator.relative_tension_rise(amplitudes))))


def truth(resonator: Resonator, amplitudes: Tensor, steps: int) -> Tensor:
    return SplittingSolver(resonator, RATE_HZ).advance(ModalState.at_rest(amplitudes[None]), steps)[0][0]


def relative(found: Tensor, expected: Tensor) -> float:
    return float((found - expected).square().sum() / expected.square().sum())


def test_without_coupling_it_is_the_damped_linear_string() -> None:
    resonator = StringParameters().resonator(20, tension_modulated=False)
    amplitudes = pluck(resonator, 0.3)
    times_s = torch.arange(1, 4001, dtype=torch.float64) / RATE_HZ
    expected = solve_linear(resonator, ModalState.at_rest(amplitudes[None]), times_s)[0]
    assert relative(slow_flow(resonator, amplitudes, RATE_HZ, 4000), expected) < 1e-11


def test_a_quiet_string_is_the_truth() -> None:
    resonator = string().resonator(20)
    amplitudes = pluck(resonator, 1e-4)
    assert relative(slow_flow(resonator, amplitudes, RATE_HZ, 12_000), truth(resonator, amplitudes, 12_000)) < 1e-12


@pytest.mark.parametrize(
    ("rise", "error", "gain"), [(0.03, 5e-10, 5000), (0.1, 3e-8, 5000), (0.2, 2e-5, 3000), (0.4, 2e-2, 50)]
)
def test_triads_are_what_averaging_lacks(rise: float, error: float, gain: float) -> None:
    resonator = string().resonator(20)
    amplitudes = pluck(resonator, rise)
    expected = truth(resonator, amplitudes, 36_000)
    found, without = (
        relative(slow_flow(resonator, amplitudes, RATE_HZ, 36_000, triads=triads), expected)
        for triads in (True, False)
    )
    assert found < error
    assert without > gain * found


def test_three_modes_trade_energy() -> None:
    """Undamped, one of them grows and falls again, by as much as the truth says."""
    resonator = replace(string(1e-5), damping_d1_kg_m_s=0.0, damping_d3_kg_m_s=0.0).resonator(3)
    amplitudes = torch.tensor([1.0, 0.6, 0.3], dtype=torch.float64)
    amplitudes *= math.sqrt(0.1 / float(resonator.relative_tension_rise(amplitudes.numpy())))
    levels = [
        frames.reshape(48, 1000, 3).square().mean(1)[:, 2] / amplitudes[2] ** 2
        for frames in (truth(resonator, amplitudes, 48_000), slow_flow(resonator, amplitudes, RATE_HZ, 48_000))
    ]
    assert levels[0].max() > 1.05 * levels[0].min()
    assert relative(levels[1], levels[0]) < 1e-4


def test_energy_falls() -> None:
    resonator = string().resonator(20)
    frames = slow_flow(resonator, pluck(resonator, 0.4), RATE_HZ, 24_000)
    energies = (torch.from_numpy(resonator.omega) * frames).square().sum(1).reshape(8, -1).mean(1)
    assert bool((energies.diff() < 0).all())


@pytest.mark.parametrize("rise", [0.8, 1.5])
def test_hard_plucks_start(rise: float) -> None:
    resonator = string().resonator(40)
    amplitudes = pluck(resonator, rise)
    found = slow_flow(resonator, amplitudes, RATE_HZ, 100)
    assert relative(found, truth(resonator, amplitudes, 100)) < 5e-4


def test_a_string_that_is_not_plucked_stays() -> None:
    resonator = string().resonator(5)
    assert not slow_flow(resonator, torch.zeros(5, dtype=torch.float64), RATE_HZ, 100).any()


def test_frames_depend_neither_on_how_many_follow_nor_on_the_nodes() -> None:
    resonator = string().resonator(12)
    amplitudes = pluck(resonator, 0.2)
    frames = slow_flow(resonator, amplitudes, RATE_HZ, 3000)
    assert relative(slow_flow(resonator, amplitudes, RATE_HZ, 100), frames[:100]) < 1e-12
    assert relative(slow_flow(resonator, amplitudes, RATE_HZ, 3000, node_s=0.37e-3), frames) < 1e-9


def test_what_it_cannot_do_is_told() -> None:
    resonator = string().resonator(3)
    amplitudes = pluck(resonator, 0.1)
    with pytest.raises(ValueError, match="coupling must be a multiple of its stretch"):
        slow_flow(replace(resonator, coupling=resonator.coupling[::-1]), amplitudes, RATE_HZ, 10)
    with pytest.raises(ValueError, match="two have nearly the same frequency"):
        slow_flow(replace(resonator, omega=resonator.omega[[0, 1, 1]]), amplitudes, RATE_HZ, 10)
    with pytest.raises(ValueError, match=r"shape \(3,\), not \(2,\)"):
        slow_flow(resonator, amplitudes[:2], RATE_HZ, 10)
    with pytest.raises(ValueError, match="node_s must be above 0"):
        slow_flow(resonator, amplitudes, RATE_HZ, 10, node_s=0.0)
    noise, many = torch.ones(20, dtype=torch.float64), string().resonator(20)
    with pytest.raises(ArithmeticError, match="pluck more softly"):
        slow_flow(many, noise, RATE_HZ, 10)


def test_a_string_stays_a_number_long_after_it_has_died() -> None:
    resonator = replace(string(), damping_d1_kg_m_s=0.08, damping_d3_kg_m_s=0.0).resonator(3)
    assert float(resonator.sigma[0]) > 50
    found = slow_flow(resonator, pluck(resonator, 0.1), 1_000.0, 20_000)
    assert found.isfinite().all()
    assert not found[-1].abs().max() > 1e-100
