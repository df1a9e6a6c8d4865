"""The truth as it is heard, against the solver that makes data, the closed form and DOP853."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from engine.levels import FULL_SCALE_M
from engine.pluck import Pluck
from engine.presets import Preset, PresetInfo
from engine.resonators.sine_transform import to_grid, to_modes
from engine.sources import TruthSource
from engine.truth import ModalState, solve_dop853
from engine.values.ear import Ear
from engine.voices import Voice, truth_program
from engine.voices.ear import weights_of
from tests.engine.tensors import solve_linear

STEREO = Ear((0.37, 0.8))
Rung = Callable[..., NDArray[np.float64]]
Initial = Callable[[PresetInfo, Pluck], NDArray[np.float64]]
Info = Callable[[bool], PresetInfo]


def relative(found: NDArray[np.float64], expected: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


@pytest.mark.parametrize("name", ["nylon_nonlinear_gaussian_4k_koopman_integrated", "studio_steel_e4"])
def test_it_is_the_string_that_models_learn(
    name: str, shipped: Callable[[str], Preset], initial_m: Initial, rung: Rung
) -> None:
    info, pluck = shipped(name).info, Pluck(0.3, 6.0)
    voice = Voice(truth_program(info, info.rate_hz), initial_m(info, pluck), STEREO)
    found = rung(info.rate_hz // 4, voice, attack=False)
    source, let_go_m = TruthSource(info), initial_m(info, pluck)
    weights = weights_of(STEREO, info.grid_points)
    frames_m, _ = source.advance(source.start(let_go_m[None]), len(found) - 1, weights)
    expected = np.concatenate([(let_go_m @ weights)[None], frames_m[0]]) / FULL_SCALE_M
    assert relative(found, expected) < 1e-4


def test_after_a_second_it_is_the_oracles(small_info: Info, initial_m: Initial, rung: Rung) -> None:
    info = small_info(True)
    let_go_m = initial_m(info, Pluck(0.3, 8.0, width=0.15))
    found = rung(8000, Voice(truth_program(info, 8000), let_go_m, STEREO), attack=False)
    start = ModalState.at_rest(torch.from_numpy(to_modes(let_go_m[None], info.modes)))
    exact = solve_dop853(info.resonator, start, 8000, 7999, rtol=1e-7, atol=1e-10)
    expected = to_grid(exact[0].numpy(), info.grid_points) @ weights_of(STEREO, info.grid_points) / FULL_SCALE_M
    assert relative(found[7000:], expected[7000:]) < 1e-4


@pytest.mark.parametrize("rate_hz", [4_000, 44_100])
def test_the_linear_string_is_exact(rate_hz: int, small_info: Info, initial_m: Initial, rung: Rung) -> None:
    """As exact as single precision, in which a device is given its samples."""
    info = small_info(False)
    let_go_m = initial_m(info, Pluck(0.3, 8.0))
    found = rung(rate_hz // 2, Voice(truth_program(info, rate_hz), let_go_m, STEREO), attack=False)
    start = ModalState.at_rest(torch.from_numpy(to_modes(let_go_m[None], info.modes)))
    exact = solve_linear(info.resonator, start, torch.arange(len(found)).double() / rate_hz)
    expected = to_grid(exact[0].numpy(), info.grid_points) @ weights_of(STEREO, info.grid_points) / FULL_SCALE_M
    assert relative(found, expected) < 1e-7


@pytest.mark.parametrize("modulated", [False, True])
def test_at_a_low_rate_no_mode_is_heard_as_another(
    modulated: bool, small_info: Info, initial_m: Initial, rung: Rung
) -> None:
    """Softly plucked, it is the string of the modes that the rate can hold."""
    info = small_info(modulated)
    omegas = [info.string.undamped_frequency(number) for number in range(1, info.modes + 1)]
    rate_hz = int(1.5 * omegas[-1] / (2 * math.pi))  # the highest lie above its half
    few = replace(info, modes=sum(omega < 3 * rate_hz for omega in omegas))
    assert 2 < few.modes < info.modes
    let_go_m = initial_m(info, Pluck(0.3, 0.01))
    found = rung(rate_hz // 4, Voice(truth_program(info, rate_hz), let_go_m, STEREO), attack=False)
    expected = rung(rate_hz // 4, Voice(truth_program(few, rate_hz), let_go_m, STEREO), attack=False)
    assert relative(found, expected) < 1e-4
    own = replace(info, rate_hz=rate_hz)  # of data of that rate, which alias as well
    aliased = rung(rate_hz // 4, Voice(truth_program(own, rate_hz), let_go_m, STEREO), attack=False)
    assert relative(aliased, expected) > 1e-3
