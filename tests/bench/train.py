"""A training step of the paper's size: 50 trajectories of 400 frames, or of 50 frames for the Fourier cells."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch

from engine.models import build_model
from engine.models.base import Physics
from engine.resonators.string import StringParameters
from tests.bench.machine import Machine, median_s
from training.configuration import Recipe
from training.data.batches import Batch
from training.fitting.losses import training_loss

BATCH = 50
FRAMES = 400
REPEATS = 5
# DMD is fitted, not trained
MODELS = ("koopman", "koopman_var", "koopman_integrated", "lru", "s5", "fgru", "frnn")
FEWER_FRAMES = {"fgru": 50, "frnn": 50}  # their cost is proportional to the number of frames


@dataclass(frozen=True)
class TrainTiming:
    """Seconds of one step: forward, the model's own loss, backward and AdamW."""

    model: str
    batch: int
    frames: int
    step_s: float


@dataclass(frozen=True)
class TrainBenchmark:
    machine: Machine
    models: tuple[TrainTiming, ...]


def measure(report: Callable[[float, str], None]) -> TrainBenchmark:
    """Measures each model at the paper's size, on random data, on which its cost does not depend."""
    found = []
    for number, name in enumerate(MODELS):
        report(number / len(MODELS), name)
        frames = min(FRAMES, FEWER_FRAMES.get(name, FRAMES))
        found.append(TrainTiming(name, BATCH, frames, _step_s(name, frames)))
    return TrainBenchmark(Machine.here(), tuple(found))


def _step_s(name: str, frames: int) -> float:
    model = build_model(name)
    physics = Physics(StringParameters().resonator(10), 4_000)
    model.initialise(model.own_initialisation(), physics, torch.Generator().manual_seed(0))
    optimiser = torch.optim.AdamW(model.parameters())
    target = torch.randn(BATCH, frames, model.grid_points, generator=torch.Generator().manual_seed(0))
    batch = Batch(target[:, 0], torch.arange(1, frames + 1), target)
    recipe = Recipe(epochs=1)

    def step() -> None:
        optimiser.zero_grad(set_to_none=True)
        training_loss(model, batch, recipe)[0].backward()
        optimiser.step()

    return median_s(step, REPEATS)
