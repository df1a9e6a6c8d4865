"""What a notebook uses: README's example, the names of `engine`, and model and truth behind one face, in metres."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile
import torch

import engine
from engine.pluck import Pluck
from engine.presets import load_preset
from engine.resonators.sine_transform import listening_weights
from engine.sources import ModelSource, Runaway, StringSource, TruthSource
from tests.engine.sounds import initial_m

ROOT = Path(__file__).parents[2]


def test_the_example_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    section = (ROOT / "README.md").read_text(encoding="utf-8").split("## From Python")[1].split("\n## ")[0]
    (example,) = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    assert len(example.strip().splitlines()) < 25
    monkeypatch.chdir(tmp_path)
    exec(compile(example, "README.md", "exec"), {})
    assert re.fullmatch(r"relative MAE [\d.e-]+\n", capsys.readouterr().out)
    sound, rate_hz = soundfile.read(tmp_path / "pluck.wav")
    assert (rate_hz, len(sound)) == (44_100, 88_200)
    assert 0.01 < abs(sound).max() <= 1


def test_every_name_is_there_and_the_engine_itself_loads_nothing_nor_effects_a_compiler():
    for name in engine.__all__:
        assert getattr(engine, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        engine.nothing  # noqa: B018
    for module, unloaded in (("engine", {"torch", "numpy", "numba"}), ("engine.effects", {"torch", "numba"})):
        code = f"import sys, {module}; assert not {unloaded} & set(sys.modules)"
        subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)


@pytest.mark.parametrize("kind", ["model", "truth"])
def test_blocks_chain_and_listening_is_the_grid_there(small_preset, kind):
    preset, weights = load_preset(small_preset), listening_weights(np.array([0.37]), 101)
    source: StringSource = ModelSource(preset) if kind == "model" else TruthSource(preset.info)
    initial = initial_m(preset.info, Pluck(0.4, 3.0))[None]
    whole, _ = source.advance(source.start(initial), 300)
    state, heard = source.start(initial), []
    for steps in (1, 64, 235):
        block, state = source.advance(state, steps, weights)
        heard.append(block)
    assert state.frame == 300
    assert source.advance(source.start(initial[:0]), 8)[0].shape == (0, 8, 101)
    with pytest.raises(ValueError, match=r"must have shape \(batch, 101\), not \(1, 50\)"):
        source.start(np.zeros((1, 50)))
    atol = 1e-5 * float(np.abs(whole).max())
    np.testing.assert_allclose(np.concatenate(heard, 1), whole @ weights, rtol=0, atol=atol)


@pytest.mark.parametrize("factor", [float("nan"), 1e9])
def test_runaway_output_is_detected_with_its_time(small_preset, factor, monkeypatch):
    preset, scale = load_preset(small_preset), torch.ones(64, 1)
    decode, scale[30:] = preset.model.decode, factor
    monkeypatch.setattr(preset.model, "decode", lambda *given: decode(*given) * scale)
    source = ModelSource(preset)
    state = source.start(initial_m(preset.info, Pluck())[None])
    with pytest.raises(Runaway, match=r"diverges 0\.008 s after the pluck") as caught:
        source.advance(state, 64)
    assert caught.value.time_s == pytest.approx(31 / 4_000)
