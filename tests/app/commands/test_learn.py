"""learn and render --as-recorded, on a synthetic recording."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import soundfile

from app.instrument import learned
from app.shared.parameters import NOISE_DB
from engine.result_file import WriteError
from tests.training.recording.sounds import membrane
from tests.training.recording.synthetic import synthetic_note
from training.recording.checkpoint import restore, save


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = synthetic_note(4, seconds=0.8)  # 317 Hz
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

    out = folder / "again.wav"  # which is without the attack
    assert run("render", "my_string", out, "--as-recorded").status == 0
    truth, rate_hz = soundfile.read(recording)
    sound, rendered_hz = soundfile.read(out)
    assert (rendered_hz, len(sound)) == (rate_hz, len(truth))
    part = slice(round(0.11 * rate_hz), round(0.85 * rate_hz))
    assert np.sum((truth[part] - sound[part]) ** 2) < 0.01 * np.sum(truth[part] ** 2)

    from app.instrument.offline import render_note
    from app.patches.library import find_patch
    from engine.presets import load_preset

    patch = find_patch("my_string").patch
    low, high = patch.range
    preset = load_preset(folder / "my_string.safetensors")
    for key in (low, (low + high) // 2, high):
        assert np.abs(render_note(patch, preset, key, 100, 0.2, 0.3, 44_100)).max() > 1e-3

    # the recorded attack sounds with the stroke, as loud at every rate, and has a switch
    assert patch.noise.kind == "recorded"
    loud, off = (patch.with_value("noise.onset_db", each) for each in (0.0, NOISE_DB[0]))
    key, energies = (low + high) // 2, []
    for rate in (44_100, 96_000):
        first, second = (render_note(each, preset, key, 100, 0.4, 0.4, rate) for each in (loud, off))
        only = (first - second)[:, 0].astype(float)
        energies.append(float(only @ only) / rate)
        assert np.abs(only[round(0.36 * rate) :]).max() < 1e-2 * np.abs(only).max()
    assert energies[0] > 1e-6 and energies[0] == pytest.approx(energies[1], rel=0.25)

    taken = run("learn", recording, "--name", "My string")
    assert "exists already" in taken.failure


def test_a_killed_command_continues_with_the_same_result(
    run, recording, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ["learn", str(recording), "--name", "Mine"]
    whole, cut = folder / "whole", folder / "cut"
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(whole))
    assert run(*words).status == 0

    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(cut))
    command = [sys.executable, "-m", "app.commands.cli", *words]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL, env=dict(os.environ)) as process:
        while process.poll() is None and steps_of(cut) <= 8:
            time.sleep(0.01)
        process.kill()
    assert steps_of(cut) > 8 and not (cut / "mine.safetensors").exists()

    restored = []

    def restore_and_note(*given: object) -> int:
        restored.append(restore(*given))
        return restored[-1]

    monkeypatch.setattr("training.recording.fit.restore", restore_and_note)
    assert run(*words).status == 0
    assert restored[0] > 8
    assert not any((cut / "unfinished").iterdir())
    assert (cut / "mine.safetensors").read_bytes() == (whole / "mine.safetensors").read_bytes()


def steps_of(folder: Path) -> int:
    """How many steps of a fit the folder's checkpoint has."""
    files = list((folder / "unfinished").glob("*.json"))
    return json.loads(files[0].read_text())["steps"] if files else 0


def test_an_interrupted_command_says_how_it_continues(run, recording, folder: Path, monkeypatch) -> None:
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(folder))

    def save_and_stop(*given: object) -> None:
        save(*given)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("training.recording.fit.save", save_and_stop)
        stopped = run("learn", recording, "--name", "Mine")
    assert stopped.status == 130
    assert "the same command continues there" in stopped.err
    (checkpoint,) = (folder / "unfinished").iterdir()
    checkpoint.write_text("{}")
    damaged = run("learn", recording, "--name", "Mine").failure
    assert "damaged checkpoint" in damaged and "delete it to start again" in damaged


def test_what_cannot_be_learned_is_reported_and_leaves_nothing(
    run, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(folder / "own"))
    noise = folder / "noise.wav"
    soundfile.write(noise, 0.1 * np.random.default_rng(0).standard_normal(88_200), 44_100)
    assert "give one plucked note" in run("learn", noise, "--name", "Noise").err
    assert not (folder / "own").exists()


def test_where_no_string_is_found_only_the_option_keeps_it(
    run, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = folder / "own"
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(own))
    samples, rate_hz = membrane(np.random.default_rng(30))
    soundfile.write(folder / "drum.wav", samples[:rate_hz], rate_hz, subtype="FLOAT")
    assert "drum.wav: no string found" in run("learn", folder / "drum.wav", "--name", "Drum").failure
    assert [path for path in own.rglob("*") if path.is_file()] == []
    kept = run("learn", folder / "drum.wav", "--name", "Drum", "--anyway", "--json")
    assert kept.status == 0, kept.err
    (found,) = json.loads(kept.out)["recordings"]
    assert found["found"] is False and found["linear_esr"] > 0
    assert (own / "drum.safetensors").is_file()


def test_only_a_learned_preset_has_a_recording(run, small_preset: Path, folder: Path) -> None:
    assert "was not learned" in run("render", small_preset, folder / "a.wav", "--as-recorded").err


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Mandolin", "Mandolin: a factory instrument has this name; choose another"),
        ("  ", "the name: must not be blank; give a name"),
        ("x" * 300, "the name: must have at most 60 characters"),
        ("a/b", "the name: must not begin or end with a full stop"),
    ],
)
def test_an_impossible_name_is_refused_before_the_fit(
    run, recording: Path, folder: Path, monkeypatch: pytest.MonkeyPatch, name: str, words: str
) -> None:
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(folder))
    monkeypatch.setattr(learned, "learn_files", lambda *_, **__: pytest.fail("it was fitted"))
    assert words in run("learn", recording, "--name", name).failure
    assert list(folder.iterdir()) == []


def test_where_an_instrument_cannot_be_written_none_of_its_files_stays(
    run, recording: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise WriteError("patches: cannot be written (No space left on device)")

    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(folder))
    monkeypatch.setattr(learned, "save_patch", full)
    assert "No space left" in run("learn", recording, "--name", "My string").failure
    assert [path for path in folder.rglob("*") if path.is_file()] == []
