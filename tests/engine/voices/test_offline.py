"""A voice for a file is what a device would be given."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from torch import Tensor

from engine.kernels import layout as at
from engine.kernels.layout import AHEAD
from engine.pluck import FULL_SCALE_M, Pluck
from engine.presets import Preset, PresetInfo, load_preset
from engine.sources import ModelSource, Runaway
from engine.voices import (
    Ear,
    Mixer,
    Program,
    Voice,
    bank_program,
    render_voice,
    rendered_program,
    truth_program,
)

NAME, PLUCK, SECONDS = "nylon_nonlinear_gaussian_4k_koopman_integrated", Pluck(0.3), 0.2
RATE_HZ = 44_100
Initial = Callable[[PresetInfo, Pluck], Tensor]


@pytest.fixture
def preset(shipped: Callable[[str], Preset]) -> Preset:
    return shipped(NAME)


def program_of(kind: str, preset: Preset) -> Program:
    if kind == "truth":
        return truth_program(preset.info, RATE_HZ)
    program = bank_program(preset.model, preset.info, RATE_HZ)
    assert program is not None
    return program


@pytest.mark.parametrize("kind", ["bank", "truth"])
@pytest.mark.parametrize("ear", [Ear((0.37,)), Ear((0.3, 0.6), "velocity", 2)])
def test_it_is_a_mixer_with_that_one_voice(kind: str, ear: Ear, preset: Preset, initial_m: Initial) -> None:
    program, frames = program_of(kind, preset), round(SECONDS * RATE_HZ)
    found = render_voice(program, ModelSource(preset), preset.info, PLUCK, ear, SECONDS)
    mixer = Mixer(RATE_HZ)
    mixer.add(Voice(program, initial_m(preset.info, PLUCK), ear))
    given = mixer.render(frames + AHEAD)[AHEAD:, : len(ear.points)]  # as a device is, by the limiter's delay later
    np.testing.assert_array_equal(found, given)
    assert mixer.take_reduction_db() == 0.0


def test_a_model_that_is_no_bank_is_rendered_and_converted(small_preset: Path, initial_m: Initial) -> None:
    preset, ear = load_preset(small_preset), Ear((0.3, 0.6))
    info, source = preset.info, ModelSource(preset)
    assert bank_program(preset.model, info, RATE_HZ) is None
    found = render_voice(rendered_program(info, info.rate_hz), source, info, PLUCK, ear, SECONDS)
    let_go_m, weights = initial_m(info, PLUCK), ear.weights(info.grid_points)
    frames_m, _ = source.advance(source.start(let_go_m[None]), len(found) - 1, weights)
    expected: NDArray[np.float64] = (torch.cat([(let_go_m @ weights)[None], frames_m[0]]) / FULL_SCALE_M).numpy()
    attack = round(0.002 * info.rate_hz)
    np.testing.assert_allclose(found[attack:], expected[attack:], atol=1e-6)  # its own rate: as it is
    higher = render_voice(rendered_program(info, 48_000), source, info, PLUCK, ear, SECONDS)
    np.testing.assert_allclose(higher[::12][attack:-4], found[attack:-4], atol=1e-5)


def test_progress_is_told_and_may_end_it(preset: Preset) -> None:
    shares: list[float] = []
    arguments = (program_of("bank", preset), ModelSource(preset), preset.info, PLUCK, Ear((0.37,)), SECONDS)
    render_voice(*arguments, shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0

    def refuse(share: float) -> None:
        raise InterruptedError

    with pytest.raises(InterruptedError):
        render_voice(*arguments, refuse)


def test_a_runaway_is_told_with_its_time(preset: Preset) -> None:
    program = program_of("bank", preset)
    program.memory[program.memory.view(np.int64)[at.O_SIGMA]] = -5e-3  # an e-fold in 50 ms
    with pytest.raises(Runaway) as caught:
        render_voice(program, ModelSource(preset), preset.info, PLUCK, Ear((0.37,)), 2.0)
    assert 0.05 < caught.value.time_s < 1.0
