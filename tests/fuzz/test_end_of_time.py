"""Every string's voice ends, whatever its model still gives, as played and in a file alike.

A model that was trained on a part of a second may settle to a hum of its own, or beside its place. Its voice ends
where the string itself is long silent. `run.py test --fuzz` renders all presets until then and prints what they give
before it; those whose end costs little are in the suite.
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
SILENT_DB = -100.0
LAST_S = 0.5
CHEAP = ("dmd", "koopman_integrated")  # compiled
RENDERED = ("nylon_nonlinear_noise_4k_koopman", "nylon_nonlinear_noise_4k_koopman_var")  # one of each model

PRESETS = sorted(SHIPPED.glob("*.safetensors"))


@pytest.mark.parametrize("path", PRESETS, ids=lambda path: path.stem)
def test_a_shipped_preset_is_silent_in_the_end_and_gives_its_place_free(path):
    info = read_info(path)
    compiled = info.model in CHEAP and (info.rate_hz == 4000 or info.model == "dmd")
    if not (LONG or compiled or path.stem in RENDERED):
        pytest.skip("run.py test --fuzz has it")
    preset = load_preset(path)
    program, source, ends_s = model_program(preset, info.rate_hz), ModelSource(preset), voice_ends_s(info)
    ends, last = round(ends_s * info.rate_hz), round(LAST_S * info.rate_hz)
    kept, frames = np.zeros(0, np.float32), 0
    for block in voice_blocks(program, source, info, Pluck(), EAR, ends_s + END_FADE_S + LAST_S):
        kept = np.concatenate([kept, block[:, 0]])[-3 * last :]
        frames += len(block)
    before = kept[: ends - (frames - len(kept))][-last:]
    print(f"\n{path.stem}: {heard_level_db(before, info.rate_hz):.0f} dB before its end at {ends_s:.0f} s")
    assert heard_level_db(kept[-last // 2 :], info.rate_hz) < SILENT_DB
    if program.ends_s < float("inf"):
        assert not kept[-last // 2 :].any()
    if program.rendered or not (LONG or info.rate_hz == 4000):  # others have a last sample
        return
    initial_m = project(Pluck().displacement(info.grid_points), info.modes)
    voice, mixer = Voice(program, initial_m, EAR), Mixer(info.rate_hz)
    mixer.add(voice)
    while not voice.over and mixer.seconds < voice_ends_s(info) + 1:
        mixer.render(4096)
    assert voice.over
