"""Work that may be killed: each writes files of a folder, and begun again in it ends with the same ones.

A process that has imported this has loaded all that the works need, so that its children begin at once.
"""

import csv
import json
from dataclasses import replace
from pathlib import Path

import torch
from safetensors.torch import save

from app.commands.cli import main
from app.window.settings import Settings, save_settings
from engine import warm
from engine.presets import SHIPPED, load_preset
from training.cell import Cell, configuration_of
from training.configuration import Run
from training.data.dataset import load_dataset
from training.run import run_rows

PRESET = SHIPPED / "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors"
RECIPE = {"epochs": 4, "batch_size": 8, "steps_per_batch": 8, "first_horizon": 10, "validate_every": 1}
CELL = Cell("koopman_var", True, "gaussian", 4000, 50, "paper")
MADE = configuration_of(CELL, {"modes": 5, "steps": 50, "count": 40}, RECIPE)
# of two runs, however equal; a developer may commit meanwhile
UNLIKE = ("seconds", "training_seconds", "finished", "commit")


def render(folder: Path) -> None:
    pluck = ["--position", "0.4", "--amplitude-mm", "2", "--seconds", "4"]
    assert main(["render", str(PRESET), str(folder / "out.wav"), *pluck]) == 0


def dataset(folder: Path) -> None:
    load_dataset(replace(MADE.data, count=400), folder / "cache")


def train(folder: Path) -> None:
    made = replace(MADE, model_configuration={"state_size": 8, "multiplier_widths": [4]})
    run, output = Run("tiny", "", made), folder / "tiny.safetensors"
    run_rows([run], folder / "runs", output=output, cache=folder / "cache", checkpoint_every_s=0.0)


def save_many_settings(folder: Path) -> None:
    for number in range(100, -1, -1):
        favourites = tuple(f"preset {each}" for each in range(number))
        save_settings(folder / "settings.json", Settings(favourites=favourites))


def contents(folder: Path) -> dict[str, object]:
    """What a work has made, by the names of its files; without times, and what another start may add to."""
    files = [path for path in folder.rglob("*") if path.is_file() and path.suffix != ".lock"]
    return {str(path.relative_to(folder)): _content(path) for path in files if path.name != "checkpoint.safetensors"}


def _content(path: Path) -> object:
    if path.suffix == ".safetensors":
        preset = load_preset(path)
        return replace(preset.info, training_seconds=None), save(preset.model.state_dict())
    if path.name == "row.json":
        return {name: value for name, value in json.loads(path.read_text()).items() if name not in UNLIKE}
    if path.name == "log.csv":
        with path.open(newline="") as file:
            return [{name: line[name] for name in line if name not in UNLIKE} for line in csv.DictReader(file)]
    return path.read_bytes()


torch.set_num_threads(1)  # a child has no threads of its parent's
warm.voices()
