"""learn and render --as-recorded, on a synthetic recording."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile

from tests.bench.recordings.synthetic import synthetic_note


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = synthetic_note(4)  # 317 Hz
    path = tmp_path_factory.mktemp("recordings") / "note.wav"
    soundfile.write(path, made.samples, made.rate_hz, subtype="PCM_24")
    return path


def test_a_note_becomes_an_instrument(run, recording, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(folder))
    found = run("learn", recording, "--name", "My string", "--scale-length", 0.65, "--json")
    assert found.status == 0, found.err
    data = json.loads(found.out)
    assert data["recordings"][0]["errors"]["esr"] < 0.01
    assert Path(data["preset"]) == folder / "my_string.safetensors"
    assert (folder / "bodies" / "my_string.wav").is_file() and (folder / "patches" / "my_string.json").is_file()

    out = folder / "again.wav"
    assert run("render", "my_string", out, "--as-recorded").status == 0
    truth, rate_hz = soundfile.read(recording)
    sound, rendered_hz = soundfile.read(out)
    assert (rendered_hz, len(sound)) == (rate_hz, len(truth))
    part = slice(round(0.11 * rate_hz), round(2.5 * rate_hz))
    assert np.sum((truth[part] - sound[part]) ** 2) < 0.01 * np.sum(truth[part] ** 2)

    from app.instrument.offline import render_note
    from app.patches.library import find_patch
    from engine.presets import load_preset

    patch = find_patch("my_string").patch
    low, high = patch.range
    preset = load_preset(folder / "my_string.safetensors")
    for key in (low, (low + high) // 2, high):
        assert np.abs(render_note(patch, preset, key, 100, 0.2, 0.3, 44_100)).max() > 1e-3

    taken = run("learn", recording, "--name", "My string")
    assert "exists already" in taken.failure


def test_what_cannot_be_learned_is_reported_and_leaves_nothing(
    run, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(folder / "own"))
    noise = folder / "noise.wav"
    soundfile.write(noise, 0.1 * np.random.default_rng(0).standard_normal(88_200), 44_100)
    assert "give one plucked note" in run("learn", noise, "--name", "Noise").err
    assert not (folder / "own").exists()


def test_only_a_learned_preset_has_a_recording(run, small_preset: Path, folder: Path) -> None:
    assert "was not learned" in run("render", small_preset, folder / "a.wav", "--as-recorded").err
