"""Latents that share a tension, as they are heard: against the model and the truth, at any rate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from engine.kernels import tension
from engine.kernels.fields import record_of
from engine.kernels.voice_records import TENSION_PROGRAM
from engine.levels import FULL_SCALE_M, FULL_SCALE_N
from engine.models.koopman_tension import KoopmanTension
from engine.pluck import Pluck
from engine.presets import Preset, PresetInfo, of_string
from engine.sources import ModelSource, TruthSource
from engine.truth import ModalState, SplittingSolver
from engine.values.ear import Ear
from engine.voices import Program, Voice, model_program
from engine.voices.ear import weights_of
from engine.voices.programs import truth_program
from tests.engine.sounds import Initial, Rung, Shipped, Signal, relative

STEREO = Ear((0.37, 0.8))


@pytest.fixture(scope="module")
def preset(shipped: Shipped) -> Preset:
    return of_string(shipped("studio_any_string"), rate_hz=48_000)


@pytest.fixture(scope="module")
def program(preset: Preset) -> Program:
    return model_program(preset, 48_000)


@pytest.mark.parametrize(
    ("rate_hz", "pluck", "nodes"),
    [(44_100, Pluck(0.3, 6.0), 2), (48_000, Pluck(0.3, 12.0, width=0.02), 3)],
)
def test_a_voice_is_the_model_and_the_string(
    rate_hz: int, pluck: Pluck, nodes: int, preset: Preset, initial_m: Initial, rung: Rung
) -> None:
    tuned = of_string(preset, rate_hz=rate_hz)
    info, let_go_m = tuned.info, initial_m(tuned.info, pluck)
    _, state = tuned.model.advance(tuned.model.encode(torch.from_numpy(let_go_m[None] / info.scale_m).float()), 1)
    assert state.nodes.tolist() == [nodes]
    found = rung(rate_hz // 4, Voice(model_program(tuned, rate_hz), let_go_m, STEREO), attack=False)
    weights = weights_of(STEREO, info.grid_points)
    for source in (ModelSource(tuned), TruthSource(info)):
        frames_m, _ = source.advance(source.start(let_go_m[None]), len(found) - 1, weights)
        expected = np.concatenate([(let_go_m @ weights)[None], frames_m[0]]) / FULL_SCALE_M
        hard = nodes > 2 and isinstance(source, TruthSource)
        assert relative(found, expected) < (1e-3 if hard else 1e-5)


@pytest.mark.parametrize("source", ["model", "truth"])
def test_the_force_at_the_bridge_is_that_of_the_solvers_modes(
    source: str, preset: Preset, program: Program, initial_m: Initial, rung: Rung
) -> None:
    info, resonator = preset.info, preset.info.resonator
    let_go_m = initial_m(info, Pluck(0.12, 4.0, "triangular"))
    own = program if source == "model" else truth_program(info, 48_000)
    found = rung(12_000, Voice(own, let_go_m, Ear((0.5,), "bridge")), attack=False)
    q = resonator.to_modes(let_go_m)[None]
    amplitudes, _ = SplittingSolver(resonator, 48_000).advance(ModalState.at_rest(q), len(found) - 1)
    assert resonator.end_force is not None
    expected = np.concatenate([q, amplitudes[0]]) @ resonator.end_force / FULL_SCALE_N
    assert relative(found, np.repeat(expected[:, None], 2, 1)) < 1e-4


def ringing(info: PresetInfo, frames: int) -> tuple[Signal, Signal]:
    """The preset's string so long after a pluck that raises its tension by a half, in m and m/s, (modes,)."""
    amplitudes = info.resonator.to_modes(Pluck(0.3, 1.0, "triangular").displacement(info.grid_points))
    amplitudes = amplitudes * np.sqrt(0.5 / info.resonator.relative_tension_rise(amplitudes))
    _, state = SplittingSolver(info.resonator, 48_000).advance(ModalState.at_rest(amplitudes[None]), frames)
    return state.amplitude[0], state.velocity[0]


def setting_out(program: Program, q: np.ndarray, v: np.ndarray) -> Program:
    """The program with voices that set out from these amplitudes and speeds."""
    return replace(program, start=lambda _: (q, v))


def test_a_voice_that_sets_out_from_a_ringing_string_is_the_model_and_the_string(
    preset: Preset, program: Program, rung: Rung
) -> None:
    info, model = preset.info, preset.model
    assert isinstance(model, KoopmanTension)
    q, v = ringing(info, 301)
    found = rung(16_000, Voice(setting_out(program, q, v), info.resonator.to_grid(q), STEREO), attack=False)
    points, steps = info.resonator.shapes @ weights_of(STEREO, info.grid_points), len(found) - 1
    true, _ = SplittingSolver(info.resonator, 48_000).advance(ModalState(q[None], v[None]), steps)
    encoded = model.encode(
        *(torch.from_numpy(info.resonator.to_grid(each)[None] / info.scale_m) for each in (q, v / 48_000))
    )
    for amplitudes in (model.amplitudes(encoded, steps).numpy() * info.scale_m, true):
        expected = np.concatenate([(q @ points)[None], amplitudes[0] @ points]) / FULL_SCALE_M
        assert relative(found, expected) < 1e-5


def test_what_is_set_out_comes_back(preset: Preset, program: Program) -> None:
    """Also where all modes swing alike, which no pluck does, and raise the tension by a half."""
    resonator = preset.info.resonator
    alike = np.sqrt(0.5 / resonator.relative_tension_rise(np.ones(resonator.modes))) * np.ones(resonator.modes)
    states = [*(ringing(preset.info, frames) for frames in (1, 301, 2_000)), (alike, alike * resonator.omega)]
    for q, v in states:
        voice = Voice(setting_out(program, q, v), resonator.to_grid(q), STEREO)
        tension.prepare(voice.record, record_of(program.memory, TENSION_PROGRAM), q, v)
        tension.set_out(voice.record, q, v, False)
        assert relative(voice.rows[0], q) > 1e-6
        back_q, back_v = np.empty_like(q), np.empty_like(v)
        tension.physical(voice.record, back_q, back_v)
        assert relative(back_q, q) < 1e-14
        assert relative(back_v, v) < 1e-14


def test_it_falls_silent_and_ends(preset: Preset, program: Program, initial_m: Initial, rung: Rung) -> None:
    voice = Voice(program, initial_m(preset.info, Pluck(0.3, 0.5)), STEREO)
    found = rung(48_000 * 30, voice, attack=False)
    assert voice.over and not voice.ran_away
    assert float(np.abs(found[-48_000:]).max()) == 0
