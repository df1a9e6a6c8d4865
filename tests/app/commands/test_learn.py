"""learn and render --as-recorded, on a synthetic recording."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from app.instruments.library import find_instrument
from app.player import learned
from app.player.offline import render_note
from engine.parameters import NOISE_DB
from engine.presets import load_preset
from engine.whole_file import WriteError
from tests.training.recording.sounds import membrane
from tests.training.recording.synthetic import synthetic_note
from training.recording.checkpoint import restore, save

LEARN = "learn --name My_string --scale-length 0.65"
PRESET = "my_string.safetensors"
KNOWN: dict[Path, Any] = {}


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = synthetic_note(4, seconds=0.8)  # 317 Hz
    path = tmp_path_factory.mktemp("recordings") / os.fsdecode(b"caf\xe9.wav")  # as old archives have names
    with path.open("wb") as file:
        soundfile.write(file, made.samples, made.rate_hz, subtype="PCM_24", format="WAV")
    return path


@pytest.fixture
def own(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the user's instruments."""
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(folder))
    return folder


@pytest.fixture
def learned_once(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Of all tests the first learns a recording; whether each of this one was asked to continue all the same."""
    learn_files, anyway = learned.learn_files, list[bool]()

    def learn(notes: list[Path], **options: Any) -> Any:
        anyway.append(options["anyway"])
        if notes[0] not in KNOWN:
            KNOWN[notes[0]] = learn_files(notes, **options)
        return KNOWN[notes[0]]

    monkeypatch.setattr(learned, "learn_files", learn)
    return anyway


def files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


@pytest.mark.usefixtures("learned_once")
def test_a_note_becomes_an_instrument_of_whose_files_all_or_none_are_written(
    run, recording, own, tmp_path, monkeypatch
):
    def full(*_: object) -> None:
        raise WriteError("instruments: cannot be written (No space left on device)")

    with monkeypatch.context() as instrumented:
        instrumented.setattr(learned, "save_instrument", full)
        assert "No space left" in run(LEARN, recording).failure
    assert files(own) == []
    done = run(f"{LEARN} --json", recording)
    data = json.loads(done.out)
    assert data["recordings"][0]["errors"]["esr"] < 0.01
    assert Path(data["preset"]) == own / PRESET
    assert (own / "bodies" / "my_string.wav").is_file() and (own / "instruments" / "my_string.json").is_file()

    out = tmp_path / "again.wav"  # which is without the attack
    assert run("render my_string --as-recorded", out).status == 0
    with recording.open("rb") as file:
        truth, rate_hz = soundfile.read(file)
    sound, rendered_hz = soundfile.read(out)
    assert (rendered_hz, len(sound)) == (rate_hz, len(truth))
    part = slice(round(0.11 * rate_hz), round(0.85 * rate_hz))
    assert np.sum((truth[part] - sound[part]) ** 2) < 0.01 * np.sum(truth[part] ** 2)

    instrument = find_instrument("my_string").instrument
    low, high = instrument.range
    preset, middle = load_preset(own / PRESET), (low + high) // 2
    for key in (low, middle, high):
        assert np.abs(render_note(instrument, preset, key, 100, 0.2, 0.3, 44_100)).max() > 1e-3

    # the recorded attack sounds with the stroke, as loud at every rate, and has a switch
    assert instrument.noise.kind == "recorded"
    loud, off = (instrument.with_value("noise.onset_db", each) for each in (0.0, NOISE_DB[0]))
    energies = []
    for rate in (44_100, 96_000):
        first, second = (render_note(each, preset, middle, 100, 0.4, 0.4, rate) for each in (loud, off))
        only = (first - second)[:, 0].astype(float)
        energies.append(float(only @ only) / rate)
        assert np.abs(only[round(0.36 * rate) :]).max() < 1e-2 * np.abs(only).max()
    assert energies[0] > 1e-6 and energies[0] == pytest.approx(energies[1], rel=0.25)
    assert "exists already" in run(LEARN, recording).failure


def steps_of(folder: Path) -> int:
    """The steps of a fit that the folder's checkpoint has."""
    checkpoints = list((folder / "unfinished").glob("*.json"))
    return json.loads(checkpoints[0].read_text())["steps"] if checkpoints else 0


def test_a_killed_command_continues_with_the_same_result(run, recording, own, tmp_path, monkeypatch):
    words = [*LEARN.split(), str(recording)]
    with subprocess.Popen([sys.executable, "-m", "app.commands.cli", *words], stderr=subprocess.DEVNULL) as process:
        while process.poll() is None and steps_of(own) <= 8:
            time.sleep(0.01)
        process.kill()
    assert steps_of(own) > 8 and not (own / PRESET).exists()

    restored = []

    def restore_and_note(*given: object) -> int:
        restored.append(restore(*given))
        return restored[-1]

    with monkeypatch.context() as instrumented:
        instrumented.setattr("training.recording.fit.restore", restore_and_note)
        done = run(LEARN, recording)
    assert done.status == 0 and str(own / PRESET) in done.out
    assert restored[0] > 8
    assert not any((own / "unfinished").iterdir())
    whole = KNOWN.get(recording) or learned.learn_files([recording], kind="guitar", length_m=0.65)
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path))
    learned.keep("My_string", whole, "guitar")
    assert (own / PRESET).read_bytes() == (tmp_path / PRESET).read_bytes()


def test_an_interrupted_command_names_its_continuation_and_a_damaged_checkpoint(run, recording, own, monkeypatch):
    def save_and_stop(*given: object) -> None:
        save(*given)
        raise KeyboardInterrupt

    with monkeypatch.context() as instrumented:
        instrumented.setattr("training.recording.fit.save", save_and_stop)
        stopped = run(LEARN, recording)
    assert stopped.status == 130 and "the same command continues there" in stopped.err
    (checkpoint,) = (own / "unfinished").iterdir()
    checkpoint.write_text("{}")
    damaged = run(LEARN, recording).failure
    assert "damaged checkpoint" in damaged and "delete it to start again" in damaged


def test_only_an_option_keeps_what_is_no_string(run, own, tmp_path, learned_once):
    samples, rate_hz = membrane(np.random.default_rng(30))
    drum = tmp_path / "drum.wav"
    soundfile.write(drum, samples[:rate_hz], rate_hz, subtype="FLOAT")
    assert "drum.wav: no string found" in run("learn --name Drum", drum).failure
    assert files(own) == []
    kept = run("learn --name Drum --anyway --json", drum)
    assert (kept.status, learned_once) == (0, [False, True]), kept.err
    (found,) = json.loads(kept.out)["recordings"]
    assert found["found"] is False and found["linear_esr"] > 0
    assert (own / "drum.safetensors").is_file()
