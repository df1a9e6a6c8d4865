from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from engine.presets import preset_digest
from training.heard_file import NAME, Heard, add_heard


@pytest.fixture
def installed(small_preset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of shipped presets with one good and one broken file."""
    shutil.copy(small_preset, tmp_path / "good.safetensors")
    (tmp_path / "broken.safetensors").write_bytes(b"not a preset")
    monkeypatch.setattr("engine.presets.finding.SHIPPED", tmp_path)
    return tmp_path


def test_presets_lists_every_field(run, installed: Path) -> None:
    found = run("presets", "--json")
    assert found.status == 0
    (preset,) = json.loads(found.out)
    assert preset == {
        "name": "good",
        "model": "koopman_var",
        "string": "nonlinear",
        "initial": "gaussian",
        "rate_hz": 4000,
        "horizon_steps": 400,
        "parameters": 7053,
        "rel_mse": 0.5,
        "rel_mae": 0.25,
        "test_rel_mse": None,
        "test_rel_mae": None,
        "heard": "not measured",
        "file": str(installed / "good.safetensors"),
    }


def test_a_broken_preset_is_reported_and_hides_no_other(run, installed: Path) -> None:
    found = run("presets")
    assert found.status == 0
    assert "good" in found.out
    assert found.err.startswith(f"learned-strings: {installed / 'broken.safetensors'}: not a whole safetensors file")
    assert found.err.count("\n") == 1


def test_a_preset_is_found_by_its_name(run, installed: Path) -> None:
    words = ("--position", 0.5, "--amplitude-mm", 2, "--seconds", 0.01)
    assert run("compare", "good", *words).status == 0
    assert (
        "no preset 'goood'; did you mean good? Give one of your own by its file"
        in run("compare", "goood", *words).failure
    )
    assert "`learned-strings presets` lists all" in run("compare", "other", *words).failure
    assert "missing.safetensors: no such file" in run("compare", "runs/missing.safetensors", *words).failure


def test_models_counts_the_real_modules_at_the_papers_sizes(run) -> None:
    found = {entry["name"]: entry["parameters"] for entry in json.loads(run("models", "--json").out)}
    assert found["koopman_var"] == 134_885
    assert "134,885" in run("models").out


def test_presets_of_the_users_own_folder_are_listed_and_found(
    run, installed: Path, small_preset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = tmp_path / "own"
    own.mkdir()
    for name in ("mine", "good"):  # of two of one name, the shipped one counts
        shutil.copy(small_preset, own / f"{name}.safetensors")
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(own))
    found = {entry["name"]: entry["file"] for entry in json.loads(run("presets", "--json").out)}
    assert found == {
        "good": str(installed / "good.safetensors"),
        "mine": str(own / "mine.safetensors"),
    }
    assert run("compare", "mine", "--position", 0.5, "--amplitude-mm", 2, "--seconds", 0.01).status == 0


def test_what_was_heard_is_listed_and_a_hostile_table_hides_nothing(run, installed: Path) -> None:
    good = installed / "good.safetensors"
    add_heard(installed, [Heard("good", preset_digest(good), 4.0, 9.0, 5.2, 3.0, 13.0)])
    (preset,) = json.loads(run("presets", "--json").out)
    assert preset["heard"] == "pitch 13 cents too high …"
    with (installed / NAME).open("a") as table:
        table.write("<script>,1e999,nan\n")
    reported = run("presets", "--json")
    (again,) = json.loads(reported.out)
    assert (reported.status, again) == (0, preset)
    assert f"{NAME}: line 3: holds 3 values" in reported.err
    (installed / NAME).write_bytes(b"\xff" * 100)
    reported = run("presets", "--json")
    (unknown,) = json.loads(reported.out)
    assert (reported.status, unknown["heard"]) == (0, "not measured")
    assert "not a text file" in reported.err
