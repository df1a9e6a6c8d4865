"""A bank against the models' own rendering, and that every voice minds its own business."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from engine.kernels.mixer_records import MOST_LATENTS
from engine.levels import FULL_SCALE_M
from engine.models.configurations import DMDConfiguration
from engine.models.dmd import DMD
from engine.models.integrated_phase import IntegratedPhase
from engine.pluck import Pluck
from engine.presets import Preset, PresetInfo
from engine.resonators.sine_transform import to_grid, to_modes
from engine.resonators.string import resonator_of
from engine.schema import write
from engine.sources import ModelSource
from engine.truth import ModalState, SplittingSolver
from engine.values.ear import Ear
from engine.voices import Mixer, Voice, model_program, render_voice
from engine.voices.banks import bank_program
from engine.voices.ear import weights_of
from tests.engine.tensors import solve_linear

KNOWING = "nylon_nonlinear_gaussian_4k_koopman_integrated"
HINTED = f"{KNOWING}_hinted"
NYLON, STEEL = "studio_nylon_b3", "studio_steel_e4"
EAR, STEREO, SOLO = Ear((0.37,)), Ear((0.3, 0.62)), Ear((0.37,), solo=2)

Signal = NDArray[np.float64]
Rung = Callable[..., Signal]
Strike = Callable[..., Voice]
Shipped = Callable[[str], Preset]
Initial = Callable[[PresetInfo, Pluck], Signal]


def relative(found: Signal, expected: Signal) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


@pytest.mark.parametrize(
    ("name", "ear"),
    [(KNOWING, EAR), (KNOWING, STEREO), (KNOWING, SOLO), (HINTED, SOLO), (NYLON, STEREO), (STEEL, SOLO)],
)
def test_at_the_presets_rate_it_is_the_models_own_rendering(
    name: str, ear: Ear, shipped: Shipped, initial_m: Initial, strike: Strike, rung: Rung
) -> None:
    preset, pluck = shipped(name), Pluck(0.3, 6.0)
    rate_hz = preset.info.rate_hz
    found = rung(min(rate_hz, 6000), strike(name, pluck, rate_hz, ear), attack=False)[:, : len(ear.points)]
    source, let_go_m = ModelSource(preset), initial_m(preset.info, pluck)
    weights = weights_of(ear, source.grid_points)
    frames_m, _ = source.advance(source.start(let_go_m[None]), len(found) - 1, weights)
    expected = frames_m[0] / FULL_SCALE_M
    assert relative(found[1:], expected) < 3e-5


@pytest.mark.parametrize("name", [KNOWING, HINTED, STEEL])
def test_at_any_rate_it_is_the_model_at_those_times(
    name: str, shipped: Shipped, initial_m: Initial, strike: Strike, rung: Rung
) -> None:
    preset, pluck, rate_hz = shipped(name), Pluck(0.71, 5.0), 44_100
    assert isinstance(preset.model, IntegratedPhase)
    found = rung(rate_hz, strike(name, pluck, rate_hz, STEREO), attack=False)
    frames = torch.arange(0, rate_hz, 11)
    with torch.inference_mode():
        state = preset.model.encode(
            torch.from_numpy(initial_m(preset.info, pluck)[None] / preset.info.scale_m).float()
        )
        times = frames.double() * preset.info.rate_hz / rate_hz
        weights = torch.from_numpy(weights_of(STEREO, preset.info.grid_points))
        expected = (
            (preset.model.decode(preset.model.latents(state.origin, times))[0].double() @ weights).numpy()
            * preset.info.scale_m
            / FULL_SCALE_M
        )
    assert relative(found[frames.numpy()], expected) < 3e-5


@pytest.mark.parametrize("rate_hz", [4_000, 48_000])
def test_a_dmd_of_the_linear_string_is_the_linear_string(
    rate_hz: int, small_info: Callable[[bool], PresetInfo], rung: Rung
) -> None:
    info = small_info(False)
    noise_m = 5e-3 * torch.rand(4, info.grid_points, generator=torch.Generator().manual_seed(0)).double().numpy()
    solver = SplittingSolver(resonator_of(info.string, info.modes, tension_modulated=False), info.rate_hz)
    start = ModalState.at_rest(torch.from_numpy(to_modes(noise_m, info.modes)))
    trajectories = torch.from_numpy(to_grid(solver.solve(start, 400).numpy(), info.grid_points) / info.scale_m)
    model = DMD.fit(trajectories, DMDConfiguration(info.grid_points, 2, 2 * info.modes))
    program = bank_program(model, info, rate_hz)
    assert program is not None
    let_go_m = to_grid(start.amplitude[0].numpy(), info.grid_points)
    found = rung(rate_hz // 2, Voice(program, let_go_m, EAR), attack=False)[:, :1]
    times_s = torch.arange(len(found)).double() / rate_hz
    exact = solve_linear(info.resonator, ModalState(start.amplitude[:1], start.velocity[:1]), times_s)
    expected = to_grid(exact[0].numpy(), info.grid_points) @ weights_of(EAR, info.grid_points) / FULL_SCALE_M
    assert relative(found, expected) < 3e-5


@pytest.mark.parametrize(("first", "second"), list(permutations((KNOWING, NYLON, STEEL), 2)))
def test_voices_together_are_the_sum_of_each_alone(first: str, second: str, strike: Strike, rung: Rung) -> None:
    """Of their high latents some die early, at other times: what lies in shared memory there is not theirs."""
    soft, hard = Pluck(0.3), Pluck(0.42, 8.0)
    together = rung(24_000, strike(first, soft), strike(second, hard))
    alone = rung(24_000, strike(first, soft)) + rung(24_000, strike(second, hard))
    np.testing.assert_allclose(together, alone, atol=1e-6)


@pytest.mark.parametrize("name", [KNOWING, STEEL])
def test_a_voice_that_was_not_heard_is_what_it_would_have_been(name: str, strike: Strike, rung: Rung) -> None:
    heard, kept = strike(name, Pluck(0.3, 8.0)), strike(name, Pluck(0.3, 8.0), gain=0.0)
    other, again = strike(NYLON, Pluck(0.42)), strike(NYLON, Pluck(0.42))
    expected = rung(48_000, heard, other)[24_000:]
    mixer = Mixer(48_000, limited=False)
    mixer.add(again, kept)
    mixer.render(24_000)
    kept.set_gain(1.0)
    found = mixer.render(24_000)
    np.testing.assert_allclose(found[1100:], expected[1100:], atol=1e-5)  # once it has faded in


@pytest.mark.parametrize("ear", [Ear((0.0,)), Ear((0.37,), solo=9)])
@pytest.mark.parametrize("name", [KNOWING, STEEL])
def test_what_was_silent_at_one_place_is_whole_at_another(name: str, ear: Ear, strike: Strike, rung: Rung) -> None:
    """Where nothing can be heard, the modulation is left out; elsewhere it must be there again."""
    expected = rung(14_400, strike(name, Pluck(0.3, 8.0)))
    voice, mixer = strike(name, Pluck(0.3, 8.0), ear=ear), Mixer(48_000, limited=False)
    mixer.add(voice)
    mixer.render(4800)
    assert voice.listen(EAR)
    np.testing.assert_allclose(mixer.render(9600)[1200:], expected[6000:], atol=1e-5)


def test_what_is_no_bank_has_no_program(shipped: Shipped, model: torch.nn.Module) -> None:
    preset = shipped(KNOWING)
    assert bank_program(model, preset.info, 48_000) is None  # Koopman_var: its multiplier sees every frame
    c = replace(preset.model.configuration, eigenvalue_widths=(MOST_LATENTS + 1,))
    assert bank_program(IntegratedPhase(c), preset.info, 48_000) is None


@pytest.mark.parametrize("rank", [0, MOST_LATENTS + 2])
def test_a_dmd_that_the_kernel_cannot_hold_is_rendered_ahead(
    rank: int, small_info: Callable[[bool], PresetInfo]
) -> None:
    """Its latents would be written beyond their memory; so would those of a fit to silence, which has none."""
    info = small_info(False)
    model = DMD(DMDConfiguration(info.grid_points, 16, max(rank, 2)))
    with torch.no_grad():
        model.magnitude_log.fill_(-0.01 if rank else -1e9)
    assert bank_program(model, info, 48_000) is None
    sizes = write(model.configuration)
    weights = {name: tensor.numpy() for name, tensor in model.state_dict().items()}
    assert model_program(Preset("", Path(), replace(info, model_configuration=sizes), weights), 48_000).rendered
    with torch.no_grad():
        model.magnitude_log[:MOST_LATENTS].fill_(-0.01)
        model.magnitude_log[MOST_LATENTS:].fill_(-1e9)
    program = bank_program(model, info, 48_000)
    assert program is not None and program.modes == min(max(rank, 2), MOST_LATENTS)


def test_at_a_low_rate_no_latent_is_heard_as_another(shipped: Shipped) -> None:
    """What a device of 48 kHz gives below 3.5 kHz is what one of 8 kHz gives."""
    preset, pluck = shipped(STEEL), Pluck(0.13, 2.0, width=0.03)
    programs = {rate: model_program(preset, rate) for rate in (8_000, 48_000)}
    low, high = (
        render_voice(program, ModelSource(preset), preset.info, pluck, EAR, 0.5)[:, 0]
        for program in programs.values()
    )
    window = [np.hanning(len(sound)) for sound in (low, high)]
    spectra = [np.abs(np.fft.rfft(w * sound)) / len(sound) for w, sound in zip(window, (low, high), strict=True)]
    band = slice(50, 3_500 // 2)  # bins of 2 Hz
    assert relative(spectra[0][band], spectra[1][band]) < 0.01
