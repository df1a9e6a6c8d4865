"""Work that may be killed: each writes files of a folder, and begun again in it ends with the same ones.

A process that has imported this has loaded all that the works need, so that its children begin at once.
"""

import csv
import json
import os
from dataclasses import replace
from pathlib import Path

import torch
from safetensors.torch import save

from app.commands.cli import main
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import own_instruments, read_instrument, save_instrument
from app.window.settings import Settings, save_settings
from engine import warm
from engine.presets import SHIPPED, load_preset
from training.cell import Cell, configuration_of
from training.configuration import Run, TrainingConfiguration
from training.data.dataset import load_dataset
from training.results import read_results
from training.run import run_rows

PRESET = SHIPPED / "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors"
RECIPE = {"epochs": 4, "batch_size": 8, "steps_per_batch": 8, "first_horizon": 10, "validate_every": 1}
PLAN = """description = "Two runs."
[data]
count = 10
steps = 60
[[block]]
models = ["dmd"]
strings = ["linear", "nonlinear"]
initials = ["noise"]
rates_hz = [4000]
horizons = [60]
"""
MANY = 100  # times that a small file is saved
# of two runs, however equal; a developer may commit meanwhile
UNLIKE = ("seconds", "training_seconds", "finished", "commit")


def render(folder: Path) -> None:
    pluck = ["--position", "0.4", "--amplitude-mm", "2", "--seconds", "4"]
    assert main(["render", str(PRESET), str(folder / "out.wav"), *pluck]) == 0


def dataset(folder: Path) -> None:
    load_dataset(_tiny("koopman_var", {}, 400).data, folder / "cache")


def train(folder: Path) -> None:
    _train(folder, _tiny("koopman_var", {"state_size": 8, "multiplier_widths": [4]}))


def train_lru(folder: Path) -> None:
    _train(folder, _tiny("lru", {"state_size": 8, "layers": 1}))


def sweep(folder: Path) -> None:
    plan = folder / "two.toml"
    plan.write_text(PLAN, encoding="utf-8")
    words = ["--runs", folder / "runs", "--cache", folder / "cache", "--results", folder / "rows.csv"]
    assert main(["sweep", str(plan), *map(str, words), "--workers", "1", "--threads", "1"]) == 0


def save_instruments(folder: Path) -> None:
    os.environ["LEARNED_STRINGS_PRESETS"] = str(folder)
    instrument = read_instrument(min(INSTRUMENTS.glob("*.json")))
    for number in range(MANY, -1, -1):
        described = instrument.model_copy(update={"name": "Mine", "description": f"{number} " * (1 + number % 9)})
        save_instrument(described, own_instruments() / "mine.json")


def save_many_settings(folder: Path) -> None:
    for number in range(MANY, -1, -1):
        favourites = tuple(f"preset {each}" for each in range(number))
        save_settings(folder / "settings.json", Settings(favourites=favourites))


def contents(folder: Path) -> dict[str, object]:
    """What a work has made, by the names of its files; without times, and what another start may add to."""
    files = (path for path in folder.rglob("*") if path.is_file() and path.suffix not in (".lock", ".png"))
    return {str(path.relative_to(folder)): _content(path) for path in files if path.name != "checkpoint.safetensors"}


def _content(path: Path) -> object:
    if path.suffix == ".safetensors":
        preset = load_preset(path)
        return replace(preset.info, training_seconds=None), save(preset.model.state_dict())
    if path.name == "rows.csv":
        return [replace(row, seconds=None, finished="", commit="") for row in read_results(path)]
    if path.name == "row.json":
        return {name: value for name, value in json.loads(path.read_text()).items() if name not in UNLIKE}
    if path.name in ("log.csv", "index.csv"):  # a batch lists the files it kept
        unlike = UNLIKE if path.name == "log.csv" else ("status",)
        with path.open(newline="") as file:
            return [{name: line[name] for name in line if name not in unlike} for line in csv.DictReader(file)]
    return path.read_bytes()


def _tiny(model: str, sizes: dict[str, object], count: int = 40) -> TrainingConfiguration:
    data = {"modes": 5, "steps": 50, "count": count}
    made = configuration_of(Cell(model, True, "gaussian", 4000, 50, "paper"), data, RECIPE)
    return replace(made, model_configuration=sizes)


def _train(folder: Path, configuration: TrainingConfiguration) -> None:
    run, output = Run("tiny", "", configuration), folder / "tiny.safetensors"
    run_rows([run], folder / "runs", output=output, cache=folder / "cache", checkpoint_every_s=0.0)


torch.set_num_threads(1)  # a child has no threads of its parent's
warm.voices()
