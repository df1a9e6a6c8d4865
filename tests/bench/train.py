"""A training step of the paper's size: 50 trajectories of 400 frames, or of 50 frames for the Fourier cells."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from torch.utils._python_dispatch import TorchDispatchMode

from engine.models import build_model
from engine.models.base import Physics, StringModel
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters
from tests.bench.machine import Machine, median_s
from training.configuration import Recipe
from training.data.batches import Batch
from training.fitting.losses import backward, training_loss

BATCH = 50
FRAMES = 400
REPEATS = 5
# DMD is fitted, not trained
MODELS = ("koopman", "koopman_var", "koopman_integrated", "lru", "s5", "fgru", "frnn")
FEWER_FRAMES = {"fgru": 50, "frnn": 50}  # their cost is proportional to the number of frames
TEXT = Recipe(epochs=1)  # with the loss of the paper's text
NO_KERNEL = ("empty", "new_empty", "_unsafe_view", "_local_scalar_dense", "lift_fresh")  # beside views


@dataclass(frozen=True)
class TrainTiming:
    """Seconds of one step: forward, the model's own loss, backward and AdamW.

    Attributes:
        launches: operations of loss and gradients in one pass; each launches a kernel on a GPU.
    """

    model: str
    batch: int
    frames: int
    step_s: float
    launches: int


@dataclass(frozen=True)
class TrainBenchmark:
    machine: Machine
    models: tuple[TrainTiming, ...]


def measure(report: Callable[[float, str], None]) -> TrainBenchmark:
    """Measure each model at the paper's size, on random data, on which its cost does not depend."""
    found = []
    for number, name in enumerate(MODELS):
        report(number / len(MODELS), name)
        frames = min(FRAMES, FEWER_FRAMES.get(name, FRAMES))
        _, step = training_step(name, frames)
        found.append(TrainTiming(name, BATCH, frames, median_s(step, REPEATS), launches(name, frames)))
    return TrainBenchmark(Machine.here(), tuple(found))


def training_step(name: str, frames: int) -> tuple[StringModel[Any], Callable[[], None]]:
    """A model with random data, and what takes its next step."""
    model, batch = _model_and_batch(name, BATCH, frames)
    optimiser = torch.optim.AdamW(model.parameters())

    def step() -> None:
        optimiser.zero_grad(set_to_none=True)
        backward(model, batch, TEXT)
        optimiser.step()

    return model, step


def launches(name: str, frames: int) -> int:
    """The operations of a model's loss and gradients that launch a kernel on a GPU, where a batch is one pass."""
    model, batch = _model_and_batch(name, 2, frames)
    with _Launches() as counted:
        training_loss(model, batch, TEXT)[0].backward()
    return counted.count


class _Launches(TorchDispatchMode):
    """Counts operations within, except views, allocations and numbers that are read."""

    def __init__(self) -> None:
        super().__init__()
        self.count = 0

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        returned = func._schema.returns
        view = any(each.alias_info is not None and not each.alias_info.is_write for each in returned)
        self.count += not view and func.overloadpacket.__name__ not in NO_KERNEL
        return func(*args, **(kwargs or {}))


def _model_and_batch(name: str, strings: int, frames: int) -> tuple[StringModel[Any], Batch]:
    model = build_model(name)
    physics = Physics(resonator_of(StringParameters(), 10), 4_000)
    model.initialise(model.own_initialisation(), physics, torch.Generator().manual_seed(0))
    target = torch.randn(strings, frames, model.grid_points, generator=torch.Generator().manual_seed(0))
    return model, Batch(target[:, 0], torch.arange(1, frames + 1), target)
