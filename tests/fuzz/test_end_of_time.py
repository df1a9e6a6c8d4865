"""Every string's voice ends, whatever its model still gives, as played and in a file alike.

A model may settle to a hum of its own, or beside its place; its voice ends where the string itself is long silent.
`run.py test --fuzz` renders all presets until then; those whose end costs little are in the suite.
"""

import numpy as np
import pytest

from engine.compare.audible import heard_level_db
from engine.pluck import Pluck
from engine.presets import SHIPPED, load_preset, read_info
from engine.resonators.sine_transform import project
from engine.sources import ModelSource
from engine.values.ear import Ear
from engine.voices import Mixer, Voice, model_program, voice_blocks
from engine.voices.program import voice_ends_s
from engine.voices.voice import END_FADE_S
from tests.fuzz.conftest import LONG

EAR = Ear((0.37,))
CHEAP = ("dmd", "koopman_integrated")  # compiled
RENDERED = ("nylon_nonlinear_noise_4k_koopman", "nylon_nonlinear_noise_4k_koopman_var")  # one of each model


@pytest.mark.parametrize("path", sorted(SHIPPED.glob("*.safetensors")), ids=lambda path: path.stem)
def test_a_shipped_preset_is_silent_in_the_end_and_gives_its_place_free(path):
    info = read_info(path)
    compiled = info.model in CHEAP and (info.rate_hz == 4000 or info.model == "dmd")
    if not (LONG or compiled or path.stem in RENDERED):
        pytest.skip("run.py test --fuzz has it")
    preset = load_preset(path)
    program, source, ends_s = model_program(preset, info.rate_hz), ModelSource(preset), voice_ends_s(info)
    last, kept = info.rate_hz // 2, np.zeros(0, np.float32)
    for block in voice_blocks(program, source, info, Pluck(), EAR, ends_s + END_FADE_S + 0.5):
        kept = np.concatenate([kept, block[:, 0]])[-last:]
    assert heard_level_db(kept[-last // 2 :], info.rate_hz) < -100
    assert program.ends_s == float("inf") or not kept[-last // 2 :].any()
    if program.rendered:  # others have a last sample
        return
    initial_m = project(Pluck().displacement(info.grid_points), info.modes)
    voice, mixer = Voice(program, initial_m, EAR), Mixer(info.rate_hz)
    mixer.add(voice)
    while not voice.over and mixer.seconds < voice_ends_s(info) + 1:
        mixer.render(4096)
    assert voice.over
