from __future__ import annotations

import csv
import errno
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import torch

from engine.presets import SHIPPED, load_preset, preset_digest
from tests.app.commands.conftest import FullDisk
from training.cell import load
from training.cli.training import known_errors
from training.data.dataset import load_dataset
from training.fitting.checkpoint import Checkpoint
from training.heard_file import read_heard
from training.heard_words import heard_sentence

CONFIGURATION = """
title = "Tiny"
model = "koopman_var"
model_configuration = { state_size = 8, multiplier_widths = [4] }
[data]
initial = "gaussian"
rate_hz = 4000
modes = 5
steps = 50
count = 20
[recipe]
epochs = 3
batch_size = 8
steps_per_batch = 8
first_horizon = 10
validate_every = 1
"""


@dataclass(frozen=True)
class Place:
    """Where a test trains."""

    folder: Path

    @property
    def cache(self) -> list[Any]:
        return ["--cache", self.folder / "cache"]

    @property
    def configuration(self) -> Path:
        path = self.folder / "tiny.toml"
        path.write_text(CONFIGURATION, encoding="utf-8")
        return path

    def train(self, name: str) -> list[Any]:
        runs, preset = self.folder / name, self.folder / f"{name}.safetensors"
        return ["train", self.configuration, "--runs", runs, "--output", preset, *self.cache]

    def log(self, name: str) -> list[dict[str, str]]:
        with (self.folder / name / "tiny" / "log.csv").open(newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))


@pytest.fixture
def place(tmp_path: Path) -> Place:
    return Place(tmp_path)


def test_training_writes_a_preset_and_ends_with_its_own_error(run, place: Place) -> None:
    found = run(*place.train("a"))
    assert (found.status, found.err) == (0, "")
    path = place.folder / "a.safetensors"
    info = load_preset(path).info
    lines = found.out.splitlines()
    assert lines[0] == str(path)
    assert f"rel. MSE {info.rel_mse:.4g}, rel. MAE {info.rel_mae:.4g}" in lines[1]
    assert f"rel. MSE {info.test_rel_mse:.4g}, rel. MAE {info.test_rel_mae:.4g}" in lines[2]
    heard, problems = read_heard(place.folder)
    assert problems == []
    assert lines[3].startswith("untrained   rel. MSE ")
    assert lines[5] == f"heard       {heard_sentence(heard[preset_digest(path)], path.stem)}"
    assert info.trained_range.position == (0.3, 0.7)
    assert [row["epoch"] for row in place.log("a")] == ["1", "2", "3"]


def test_a_shipped_preset_is_not_replaced(run, place: Place) -> None:
    runs = place.folder / "runs"
    found = run("train", place.configuration, "--runs", runs, *place.cache)
    assert found.out.splitlines()[0] == str(runs / "tiny" / "tiny.safetensors")
    assert not (SHIPPED / "tiny.safetensors").exists()


def test_known_errors_are_the_papers_and_the_projects() -> None:
    koopman = known_errors(load("nylon_nonlinear_noise_4k_koopman_400"))
    assert koopman["paper"] == (0.0036, 0.0353) and koopman["project"][0] < 0.0045
    assert set(known_errors(load("nylon_nonlinear_noise_4k_koopman_integrated_400_blind"))) == {"project"}
    assert known_errors(load("studio_nylon_b3")) == {}  # data of its own


def test_a_run_of_ones_own_takes_another_seed(run, place: Place) -> None:
    words = place.train("seeded")
    assert run(*words).status == run(*words, "--seed", 0).status == 0  # its own: the same run
    own = load_preset(place.folder / "seeded.safetensors")
    assert run(*words, "--seed", 5).status == 0
    other = load_preset(place.folder / "seeded.safetensors")
    assert sorted(each.name for each in (place.folder / "seeded").iterdir()) == ["tiny", "tiny_seed5"]
    assert other.info.title == f"{own.info.title}, seed 5"
    weights = own.model.state_dict(), other.model.state_dict()
    assert any(not torch.equal(weights[0][name], weights[1][name]) for name in weights[0])
    twice = run("train", "nylon_linear_gaussian_4k_lru_seed3", "--seed", 5)
    assert twice.status == 2 and "has a seed already" in twice.err


def test_seeds_are_trained_together_and_their_mean_is_printed(run, place: Place) -> None:
    runs = place.folder / "runs"
    done = run("train", place.configuration, "--runs", runs, "--seeds", 2, *place.cache)
    assert done.status == 0, done.err
    names = ("tiny", "tiny_seed1")
    errors = [load_preset(runs / name / f"{name}.safetensors").info.rel_mse for name in names]
    middle, deviation = sum(errors) / 2, abs(errors[0] - errors[1]) / 2**0.5
    assert f"2 seeds     rel. MSE {middle:.4g} ± {deviation:.4g}" in done.out
    again = run("train", place.configuration, "--runs", runs, "--seeds", 2, *place.cache)
    assert "finished earlier, nothing was trained now" in again.out
    usage = run(*place.train("one"), "--seeds", 2).usage
    assert "--output" in usage


def test_a_killed_run_goes_on_to_the_same_weights(run, place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("training.fitting.fit.CHECKPOINT_EVERY_S", -1)
    assert run(*place.train("whole")).status == 0

    save = Checkpoint.save

    def save_and_kill(self: Checkpoint, path: Path) -> None:
        if self.facts["step"] == 4:
            raise KeyboardInterrupt  # epoch 2 is in the log, and its checkpoint is not written
        save(self, path)

    with monkeypatch.context() as patched:
        patched.setattr(Checkpoint, "save", save_and_kill)
        killed = run(*place.train("cut"))
    assert killed.status == 130
    assert "the same command continues with" in killed.err
    assert not (place.folder / "cut.safetensors").exists()

    assert run(*place.train("cut")).status == 0
    whole, cut = (load_preset(place.folder / f"{name}.safetensors").model.state_dict() for name in ("whole", "cut"))
    assert all(torch.equal(whole[name], cut[name]) for name in whole)
    rows = place.log("cut")
    assert [row["epoch"] for row in rows] == ["1", "2", "3"]
    assert [row["loss"] for row in rows] == [row["loss"] for row in place.log("whole")]


def test_a_run_of_another_configuration_is_refused(run, place: Place) -> None:
    run(*place.train("a"))
    text = CONFIGURATION.replace("epochs = 3", "epochs = 4")
    other = place.folder / "other"
    other.mkdir()
    (other / "tiny.toml").write_text(text, encoding="utf-8")
    words = [
        "train",
        other / "tiny.toml",
        "--runs",
        place.folder / "a",
        "--output",
        place.folder / "b",
        *place.cache,
    ]
    assert "was trained with other settings; delete it" in run(*words).failure


@pytest.mark.parametrize("bytes_left", [0, 100, 15_000])
def test_a_full_disk_leaves_no_half_data_set(place: Place, bytes_left: int, full_disk: FullDisk) -> None:
    configuration, cache = load(str(place.configuration)).data, place.folder / "cache"
    load_dataset(configuration, cache)
    (made,) = (path for path in (place.folder / "cache" / "datasets").iterdir() if path.is_dir())
    whole = {path.name: path.read_bytes() for path in made.iterdir()}
    shutil.rmtree(made)
    with full_disk(bytes_left), pytest.raises(OSError) as full:
        load_dataset(configuration, cache)
    assert (full.value.filename, full.value.errno) == (str(made), errno.EFBIG)
    assert [path.suffix for path in made.parent.iterdir()] == [".lock"]
    load_dataset(configuration, cache)
    assert {path.name: path.read_bytes() for path in made.iterdir()} == whole


def test_a_configuration_that_is_not_there_is_reported(run) -> None:
    assert "no training configuration 'nothing'" in run("train", "nothing").failure


def test_a_wrong_field_is_reported(run, place: Place) -> None:
    path = place.folder / "wrong.toml"
    path.write_text(CONFIGURATION.replace("epochs", "epoch"), encoding="utf-8")
    assert f"{path}.recipe: unknown field 'epoch'" in run("train", path).failure


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a CUDA device")
def test_a_device_that_is_not_there_is_reported(run, place: Place) -> None:
    assert "no CUDA device can be used here" in run(*place.train("a"), "--device", "cuda").failure
