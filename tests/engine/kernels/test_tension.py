"""Latents that share a tension, as they are heard: against the model and the truth, at any rate."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from torch import Tensor

from engine.pluck import FULL_SCALE_M, Pluck
from engine.presets import Preset, PresetInfo, of_string
from engine.sources import ModelSource, TruthSource
from engine.voices import Ear, Voice, bank_program

STEREO = Ear((0.37, 0.8))
Rung = Callable[..., NDArray[np.float64]]
Initial = Callable[[PresetInfo, Pluck], Tensor]


def relative(found: NDArray[np.float64], expected: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


@pytest.mark.parametrize(
    ("rate_hz", "pluck", "nodes"),
    [(44_100, Pluck(0.3, 6.0), 2), (48_000, Pluck(0.3, 6.0), 2), (48_000, Pluck(0.3, 12.0, width=0.02), 3)],
)
def test_a_voice_is_the_model_and_the_string(
    rate_hz: int, pluck: Pluck, nodes: int, shipped: Callable[[str], Preset], initial_m: Initial, rung: Rung
) -> None:
    preset = of_string(shipped("studio_any_string"), rate_hz=rate_hz)
    info = preset.info
    let_go_m = initial_m(info, pluck)
    _, state = preset.model.advance(preset.model.encode((let_go_m[None] / info.scale_m).float()), 1)
    assert state.nodes.tolist() == [nodes]
    program = bank_program(preset.model, info, rate_hz)
    assert program is not None
    found = rung(rate_hz // 4, Voice(program, let_go_m, STEREO), attack=False)
    weights = STEREO.weights(info.grid_points)
    for source in (ModelSource(preset), TruthSource(info)):
        readout = weights.float() if isinstance(source, ModelSource) else weights
        frames_m, _ = source.advance(source.start(let_go_m[None]), len(found) - 1, readout)
        expected = torch.cat([(let_go_m @ weights)[None], frames_m[0].double()]).numpy() / FULL_SCALE_M
        hard = nodes > 2 and isinstance(source, TruthSource)
        assert relative(found, expected) < (1e-3 if hard else 1e-5)


def test_it_falls_silent_and_ends(shipped: Callable[[str], Preset], initial_m: Initial, rung: Rung) -> None:
    preset = shipped("studio_any_string")
    program = bank_program(preset.model, preset.info, 48_000)
    assert program is not None
    voice = Voice(program, initial_m(preset.info, Pluck(0.3, 0.5)), STEREO)
    found = rung(48_000 * 30, voice, attack=False)
    assert voice.over
    assert not voice.ran_away
    assert float(np.abs(found[-48_000:]).max()) == 0
