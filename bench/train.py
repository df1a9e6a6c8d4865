"""A training step of the paper's size: 50 trajectories of 400 frames, or of 50 frames for the Fourier cells."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

import torch
from torch.utils._python_dispatch import TorchDispatchMode

from bench.machine import REPEATS, median_s
from engine.models import build_model
from engine.models.base import Physics, StringModel
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters
from training.cell import Cell, configuration_of
from training.cli.console import ProgressReport
from training.configuration import Recipe
from training.data.batches import Batch
from training.data.dataset import Dataset
from training.fitting import recorded
from training.fitting.fit import Steps, TrainingState, take_step
from training.fitting.losses import backward, training_loss

BATCH = 50
FRAMES = 400
# DMD is fitted, not trained
MODELS = ("koopman", "koopman_var", "koopman_integrated", "lru", "s5", "fgru", "frnn")
FEWER_FRAMES = {"fgru": 50, "frnn": 50}  # their cost is proportional to the number of frames
SEEDS = {"koopman_var": 5, "koopman": 5, "lru": 5, "s5": 5, "fgru": 1}  # on a GPU
STEPS = 5  # for a difference, of which `recorded.BEFORE` are not yet repeated
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
class SeedsTiming:
    """Time of a step of several seeds at once on a GPU, by the recipe of the paper's text.

    Attributes:
        launched_ms: with each kernel launched by itself.
        step_ms: recorded and repeated, as training does it.
        difference: of the loss after `STEPS` steps, repeated and launched, relative; both without tensor cores.
        prepare_s: from the first step to the end of the recording.
    """

    model: str
    seeds: int
    frames: int
    launched_ms: float
    step_ms: float
    difference: float
    prepare_s: float


def measure(report: ProgressReport) -> dict[str, Any]:
    """Measure each model at the paper's size, on random data, on which its cost does not depend."""
    found = []
    for number, name in enumerate(MODELS):
        report(number / len(MODELS), name)
        frames = min(FRAMES, FEWER_FRAMES.get(name, FRAMES))
        _, step = training_step(name, frames)
        found.append(TrainTiming(name, BATCH, frames, median_s(step), launches(name, frames)))
    return {"models": tuple(found)}


def measure_on_gpu(report: ProgressReport) -> dict[str, Any]:
    """Measure steps of several seeds at once on the GPU."""
    found = []
    for number, (name, seeds) in enumerate(SEEDS.items()):
        report(number / len(SEEDS), name)
        found.append(_seeds_timing(name, seeds))
    return {"device": torch.cuda.get_device_name(), "models": tuple(found)}


def _seeds_timing(name: str, seeds: int) -> SeedsTiming:
    """See `SeedsTiming`. The random data have the paper's size."""
    cells = [Cell(name, True, "noise", 4000, FRAMES, "paper", seed) for seed in range(seeds)]
    configurations = [configuration_of(cell, recipe={"batch_size": BATCH}) for cell in cells]
    modes = torch.randn(1000, FRAMES + 1, configurations[0].data.modes, generator=torch.Generator().manual_seed(0))
    dataset = Dataset(configurations[0].data, modes / 1000, 1e-3)

    def made() -> list[TrainingState]:
        return [TrainingState(each, dataset, torch.device("cuda")) for each in configurations]

    with patch.object(recorded, "PRECISION", "highest"):
        launched, repeated = made(), made()
        _launch(launched)
        launched_s = _seconds(lambda: _launch(launched), STEPS - 1)
        steps = Steps()
        for _ in range(STEPS):
            steps.take(repeated)
    difference = max(abs(two.loss / one.loss - 1) for one, two in zip(launched, repeated, strict=True))
    runs, steps = made(), Steps()
    prepare_s = (recorded.BEFORE + 1) * _seconds(lambda: steps.take(runs), recorded.BEFORE + 1)
    step_s = statistics.median(_seconds(lambda: steps.take(runs), 2 * STEPS) for _ in range(REPEATS))
    return SeedsTiming(name, seeds, FRAMES, 1000 * launched_s, 1000 * step_s, difference, prepare_s)


def _launch(runs: list[TrainingState]) -> None:
    for run in runs:
        run.begin_step()
    take_step(runs)
    for run in runs:
        run.end_step()


def _seconds(work: Callable[[], None], times: int) -> float:
    """Seconds of one of some calls, none of which waits for the GPU."""
    torch.cuda.synchronize()
    started = time.perf_counter()
    for _ in range(times):
        work()
    torch.cuda.synchronize()
    return (time.perf_counter() - started) / times


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
