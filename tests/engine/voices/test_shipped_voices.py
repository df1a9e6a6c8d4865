"""Voices of all studio strings against their definitions: the model's latents, and the solver's motion."""

from __future__ import annotations

import numpy as np
import pytest

from engine.levels import FULL_SCALE_M
from engine.pluck import Pluck
from engine.presets import SHIPPED, load_preset, preset_files
from engine.resonators.sine_transform import project
from engine.sources import ModelSource, TruthSource
from engine.values.ear import Ear
from engine.voices import Mixer, Voice, model_program, truth_program
from engine.voices.ear import weights_of
from engine.voices.voice import ATTACK_S

STUDIO = sorted(path.stem for path in preset_files(SHIPPED) if path.stem.startswith("studio_"))
EAR, PLUCK, SOUND_S = Ear((0.37,)), Pluck(), 0.05
# the harp's C6, the highest of all, is beyond what was trained, and its truth at 1.9e-4
ALLOWED = {"studio_any_harp_c6": 3e-4}


@pytest.mark.parametrize("kind", ["model", "truth"])
@pytest.mark.parametrize("name", STUDIO)
def test_a_voice_is_its_definition(name: str, kind: str) -> None:
    preset = load_preset(SHIPPED / f"{name}.safetensors")
    info = preset.info
    if kind == "model":
        program, source = model_program(preset, info.rate_hz), ModelSource(preset)
    else:
        program, source = truth_program(info, info.rate_hz), TruthSource(info)
    frames, first = round(SOUND_S * info.rate_hz), round(ATTACK_S * info.rate_hz)
    initial_m = project(PLUCK.displacement(info.grid_points), info.modes)
    voice, mixer = Voice(program, initial_m, EAR), Mixer(info.rate_hz, limited=False)
    voice.never_ends()
    mixer.add(voice)
    found = mixer.render(frames)[first:, 0].astype(np.float64)
    blocks, _ = source.advance(source.start(initial_m[None]), frames - 1, weights_of(EAR, info.grid_points))
    expected = blocks[0, first - 1 :, 0].astype(np.float64) / FULL_SCALE_M
    assert np.linalg.norm(found - expected) < ALLOWED.get(name, 1e-4) * np.linalg.norm(expected)
