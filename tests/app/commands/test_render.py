from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from engine.bounds import LARGEST_PRESET_BYTES
from engine.presets.file import METADATA_KEY


def render(preset: object, out: Path, *more: Any, position: float = 0.4, amplitude_mm: float = 3) -> list[Any]:
    pluck = ["--position", position, "--amplitude-mm", amplitude_mm]
    return ["render", preset, out, *pluck, "--seconds", 0.1, *more]


@pytest.mark.parametrize(
    ("bits", "subtype"), [(None, "PCM_24"), ("16", "PCM_16"), ("24", "PCM_24"), ("32f", "FLOAT")]
)
def test_every_format_is_written_and_reported(
    run, small_preset, folder: Path, bits: str | None, subtype: str
) -> None:
    out = folder / "a.wav"
    found = run(*render(small_preset, out, *(["--bits", bits] if bits else [])))
    assert (found.status, found.err) == (0, "")
    assert found.out.startswith(f"{out}: 400 frames at 4000 Hz, ")
    with soundfile.SoundFile(out) as file:
        assert (file.subtype, file.samplerate, file.frames) == (subtype, 4000, 400)
        assert json.loads(file.comment)["pluck"]["amplitude_mm"] == 3
    assert list(folder.iterdir()) == [out]


def test_options_reach_the_file(run, small_preset: Path, folder: Path) -> None:
    out = folder / "a.wav"
    more = [
        "--rate",
        48_000,
        "--listen",
        0.2,
        "--source",
        "truth",
        "--shape",
        "raised_cosine",
        "--width",
        0.2,
    ]
    assert run(*render(small_preset, out, *more)).status == 0
    with soundfile.SoundFile(out) as file:
        recipe = json.loads(file.comment)
        assert (file.samplerate, file.frames) == (48_000, 4800)
    assert (recipe["listen"], recipe["source"], recipe["rate_hz"]) == (0.2, "truth", 48_000)
    assert recipe["pluck"] == {"position": 0.4, "amplitude_mm": 3.0, "shape": "raised_cosine", "width": 0.2}


def test_the_difference_is_model_minus_truth(run, small_preset: Path, folder: Path) -> None:
    sounds = {}
    for source in ("model", "truth", "difference"):
        run(*render(small_preset, folder / f"{source}.wav", "--source", source, "--bits", "32f"))
        sounds[source], _ = soundfile.read(folder / f"{source}.wav")
    assert np.abs(sounds["difference"]).max() > 1e-3
    assert sounds["difference"] == pytest.approx(sounds["model"] - sounds["truth"], abs=1e-6)


def test_what_lies_past_or_outside_the_training_is_reported(run, small_preset: Path, folder: Path) -> None:
    found = run(*render(small_preset, folder / "a.wav", "--seconds", 0.2, position=0.1))
    assert found.err.splitlines() == [
        "learned-strings: warning: position 0.1 is outside the trained 0.3 … 0.7",
        "learned-strings: note: from 0.1 s on, the model is past its training",
    ]


def test_silence_is_explained(run, small_preset: Path, folder: Path) -> None:
    found = run(*render(small_preset, folder / "a.wav", "--source", "truth", amplitude_mm=0))
    assert found.status == 0
    assert "the file is silent; amplitude 0" in found.err


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--position", 0], "--position: must lie in 0.02 … 0.98, not 0"),
        (["--amplitude-mm", 21], "--amplitude-mm: must lie in 0 … 20 mm, not 21"),
        (["--listen", 1.01], "--listen: must lie in 0 … 1, not 1.01"),
        (["--seconds", 601], "--seconds: must lie in 0 … 600 s, not 601"),
        (["--seconds", "nan"], "--seconds: must lie in 0 … 600 s, not nan"),
        (["--seconds", 0], "--seconds: must hold a sample of 4000 Hz, not 0 s"),
        (["--width", 1.6], "--width: must lie in 0.02 … 1, not 1.6"),
        (["--rate", 999], "--rate: must lie in 1000 … 384000 Hz, not 999"),
        (["--bits", 8], "--bits"),
        (["--source", "all"], "--source"),
        (["--source", "both", "--listen-right", 0.2], "--source: model and truth cannot share one file in stereo"),
        (["--decay-db", 5], "--decay-db: must lie in 10 … 120 dB, not 5"),
        (["--shape", "square"], "--shape"),
    ],
)
def test_options_out_of_range_are_bad_usage(
    run, small_preset: Path, folder: Path, more: list[Any], message: str
) -> None:
    assert message in run(*render(small_preset, folder / "a.wav"), *more).usage.replace("'", "")
    assert list(folder.iterdir()) == []


def test_an_unwritable_place_is_reported(run, small_preset: Path, folder: Path) -> None:
    out = folder / "missing" / "a.wav"
    assert f"{out}: cannot be written" in run(*render(small_preset, out)).failure
    folder.with_suffix(".wav").mkdir()
    assert "not a file that can be replaced" in run(*render(small_preset, folder.with_suffix(".wav"))).failure


def test_a_full_disk_leaves_no_file(run, small_preset: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(self: Path, target: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "replace", full)
    failure = run(*render(small_preset, folder / "a.wav")).failure
    assert "a.wav: cannot be written (No space left on device); free some space" in failure
    assert list(folder.iterdir()) == []


Tensors = dict[str, torch.Tensor]


def _missing_tensor(tensors: Tensors, facts: dict[str, Any]) -> None:
    del tensors["nu_log"]


def _re_typed(tensors: Tensors, facts: dict[str, Any]) -> None:
    tensors["nu_log"] = tensors["nu_log"].double()


def _re_shaped(tensors: Tensors, facts: dict[str, Any]) -> None:
    tensors["nu_log"] = tensors["nu_log"][:-1].clone()


def _not_finite(tensors: Tensors, facts: dict[str, Any]) -> None:
    tensors["nu_log"][3] = torch.nan


def _newer(tensors: Tensors, facts: dict[str, Any]) -> None:
    facts["format_version"] = 99


def _impossible(tensors: Tensors, facts: dict[str, Any]) -> None:
    facts["rate_hz"] = -1


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (_missing_tensor, "tensor 'nu_log' is missing"),
        (_re_typed, "tensor 'nu_log' is of type F64, expected F32"),
        (_re_shaped, "tensor 'nu_log' has shape (15,), expected (16,)"),
        (_not_finite, "tensor 'nu_log' holds values that are not finite"),
        (_newer, "format_version 99 is newer than this program's 5; update the program"),
        (_impossible, "rate_hz must be above 0"),
    ],
)
def test_a_damaged_preset_is_reported(
    run, small_preset, folder, tmp_path, damage: Callable[[Tensors, dict[str, Any]], None], message: str
) -> None:
    with safe_open(small_preset, framework="pt") as file:
        tensors = {name: file.get_tensor(name).clone() for name in file.keys()}  # noqa: SIM118 - not a mapping
        facts = json.loads(file.metadata()[METADATA_KEY])
    damage(tensors, facts)
    path = tmp_path / "bad.safetensors"
    save_file(tensors, path, metadata={METADATA_KEY: json.dumps(facts)})
    failure = run(*render(path, folder / "a.wav")).failure
    assert failure.startswith(f"learned-strings: {path}: ")
    assert message in failure
    assert list(folder.iterdir()) == []


def test_a_missing_truncated_or_oversized_preset_is_reported(run, small_preset, folder: Path, tmp_path: Path) -> None:
    out, path = folder / "a.wav", tmp_path / "bad.safetensors"
    assert f"{path}: no such file" in run(*render(path, out)).failure
    path.write_bytes(small_preset.read_bytes()[:-50])
    assert f"{path}: not a whole safetensors file" in run(*render(path, out)).failure
    os.truncate(path, LARGEST_PRESET_BYTES + 1)
    assert f"{path}: 64 MiB is more than" in run(*render(path, out)).failure
    assert list(folder.iterdir()) == []
