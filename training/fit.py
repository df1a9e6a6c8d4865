"""Fitting a model to a data set: the loop, its schedules, its checkpoints.

Every random choice is a function of (seed, iteration), and every schedule of the iteration alone, so that a run
continued from a checkpoint is the run that was never interrupted, bit for bit (same machine, same threads).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from engine.metrics import RelativeError
from engine.models import StringModel, build_model
from engine.models.base import Physics
from engine.schema import write
from engine.sine_transform import synthesis_matrix
from training.checkpoint import Checkpoint, optimiser_moments, restore_moments
from training.configuration import Recipe, TrainingConfiguration
from training.dataset import Dataset
from training.evaluate import evaluate_model
from training.losses import loss_terms

CHECKPOINT_EVERY_S = 45.0


class Diverged(RuntimeError):
    """The loss is no longer finite."""


@dataclass(frozen=True)
class Progress:
    """A line of the run's log."""

    epoch: int
    epochs: int
    horizon: int
    learning_rate: float
    loss: float
    validation: RelativeError | None
    seconds: float
    seconds_left: float


@dataclass(frozen=True)
class FitResult:
    """The model of the best validation MAE, and what it took."""

    model: StringModel[Any]
    validation: RelativeError
    best_epoch: int
    seconds: float


def fit(
    configuration: TrainingConfiguration,
    dataset: Dataset,
    run_folder: Path,
    *,
    device: torch.device | str = "cpu",
    report: Callable[[Progress], None] = lambda progress: None,
) -> FitResult:
    """Trains, or goes on with the run in `run_folder`.

    Raises:
        Diverged: the loss became infinite or not a number.
        ValueError: the checkpoint there is damaged or of another configuration.
    """
    recipe = configuration.recipe
    data = _TrainingData(dataset, torch.device(device))
    model = new_model(configuration, dataset.scale_m).to(device)
    optimiser = torch.optim.AdamW(
        [
            {"params": [p for n, p in model.named_parameters() if not _is_eigenvalue(n)], "share": 1.0},
            {
                "params": [p for n, p in model.named_parameters() if _is_eigenvalue(n)],
                "share": recipe.eigenvalue_rate,
                "weight_decay": 0.0,
            },
        ],
        lr=recipe.peak_learning_rate,
        weight_decay=recipe.weight_decay,
    )
    batches = -(-data.count // recipe.batch_size)
    path = run_folder / "checkpoint.safetensors"
    plain = write(configuration)
    best_state, best = _clone(model), None
    epoch, earlier_s = 0, 0.0
    best_epoch = 0
    if path.exists():
        checkpoint = Checkpoint.load(path)
        if checkpoint.facts["configuration"] != plain:
            raise ValueError(f"{path}: belongs to another configuration; delete it or choose another run folder")
        model.load_state_dict(dict(checkpoint.model))
        best_state = {name: t.to(device) for name, t in checkpoint.best_model.items()}
        restore_moments(optimiser, checkpoint.optimiser)
        epoch, earlier_s = checkpoint.facts["epoch"], checkpoint.facts["seconds"]
        best_epoch = checkpoint.facts["best_epoch"]
        best = RelativeError(**checkpoint.facts["best"]) if checkpoint.facts["best"] else None

    started = saved = time.monotonic()
    first_epoch = epoch
    while epoch < recipe.epochs:
        total = 0.0
        model.train()
        for batch, rows in enumerate(_batches(recipe, data.count, epoch)):
            iteration = epoch * batches + batch
            horizon = horizon_at(recipe, iteration / (recipe.epochs * batches), dataset.configuration.steps)
            for group in optimiser.param_groups:
                group["lr"] = learning_rate_at(recipe, iteration / (recipe.epochs * batches)) * group["share"]
            initial, frames, target = data.draw(recipe, rows, horizon, iteration)
            terms = loss_terms(model, initial, frames, target)
            weights = (recipe.prediction_weight, recipe.encoding_weight, recipe.consistency_weight)
            loss = torch.stack([w * term for w, term in zip(weights, terms, strict=True)]).sum()
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            torch.nn.utils.clip_grad_norm_(model.parameters(), recipe.clip_norm)
            optimiser.step()
            total += float(terms[0].detach())
        epoch += 1
        if not math.isfinite(total):
            raise Diverged(f"the loss is {total} in epoch {epoch}; lower peak_learning_rate")
        validation = None
        if epoch % recipe.validate_every == 0 or epoch == recipe.epochs:
            validation = evaluate_model(model, dataset, "validation").total()
            if best is None or validation.rel_mae < best.rel_mae:
                best, best_state, best_epoch = validation, _clone(model), epoch
        now = time.monotonic()
        seconds = earlier_s + now - started
        report(
            Progress(
                epoch,
                recipe.epochs,
                horizon,
                optimiser.param_groups[0]["lr"],
                total / batches,
                validation,
                seconds,
                (now - started) / (epoch - first_epoch) * (recipe.epochs - epoch),
            )
        )
        if now - saved > CHECKPOINT_EVERY_S or epoch == recipe.epochs:
            facts = {
                "configuration": plain,
                "epoch": epoch,
                "seconds": seconds,
                "best": write(best) if best else None,
                "best_epoch": best_epoch,
            }
            Checkpoint(model.state_dict(), best_state, optimiser_moments(optimiser), facts).save(path)
            saved = now
    assert best is not None
    model.load_state_dict(best_state)
    return FitResult(model.eval(), best, best_epoch, earlier_s + time.monotonic() - started)


def new_model(configuration: TrainingConfiguration, scale_m: float) -> StringModel[Any]:
    """The untrained model of a run, initialised from its seed; `scale_m` is its data set's."""
    data = configuration.data
    model = build_model(configuration.model, configuration.model_configuration)
    model.initialise(
        configuration.recipe.initialisation or model.initialisations[0],
        Physics(data.string, data.modes, data.rate_hz, scale_m, data.tension_modulated),
        torch.Generator().manual_seed(configuration.recipe.seed),
    )
    return model


def learning_rate_at(recipe: Recipe, share: float) -> float:
    """One cycle: a linear warm-up to the peak, then a cosine to zero. `share`: of the run, 0 … 1."""
    if share < recipe.warm_up:
        return recipe.peak_learning_rate * (0.04 + 0.96 * share / recipe.warm_up)
    return recipe.peak_learning_rate * 0.5 * (1 + math.cos(math.pi * (share - recipe.warm_up) / (1 - recipe.warm_up)))


def horizon_at(recipe: Recipe, share: float, steps: int) -> int:
    """Frames in reach of the loss: geometric growth from the first horizon to `steps`."""
    first = min(recipe.first_horizon, steps)
    if share >= recipe.grow_until:
        return steps
    return round(first * (steps / first) ** (share / recipe.grow_until))


class _TrainingData:
    """The training split on the device, and random batches of it in normalised displacement."""

    def __init__(self, dataset: Dataset, device: torch.device) -> None:
        c = dataset.configuration
        self._amplitudes = dataset.split("train").to(device)
        self._synthesis = (synthesis_matrix(c.grid_points, c.modes) / dataset.scale_m).float().to(device)
        self._mirror = torch.tensor([(-1.0) ** n for n in range(c.modes)], device=device)  # x -> ℓ - x
        self.count = len(self._amplitudes)

    def draw(self, recipe: Recipe, rows: Tensor, horizon: int, iteration: int) -> tuple[Tensor, Tensor, Tensor]:
        """Frame 0 (batch, grid), frame numbers (frames,) and those frames (batch, frames, grid)."""
        device = self._amplitudes.device
        generator = torch.Generator().manual_seed((recipe.seed + 1) * 1_000_003 + iteration)
        count = min(recipe.steps_per_batch, horizon)
        # one frame from each of `count` equal parts of the horizon: less noise than independent draws
        edges = torch.arange(count) * horizon / count
        frames = (edges + torch.rand(count, generator=generator) * horizon / count).long().clamp(max=horizon - 1) + 1
        wanted = torch.cat([torch.zeros(1, dtype=torch.long), frames]).to(device)
        amplitudes = self._amplitudes[rows.to(device)[:, None], wanted[None, :]]
        if recipe.flip:
            coin = torch.randint(0, 2, (2, len(rows), 1, 1), generator=generator).to(device)
            amplitudes = amplitudes * (1 - 2 * coin[0]) * torch.where(coin[1] == 1, self._mirror, 1.0)
        displacement = amplitudes @ self._synthesis
        return displacement[:, 0], wanted[1:], displacement[:, 1:]


def _batches(recipe: Recipe, count: int, epoch: int) -> Iterator[Tensor]:
    generator = torch.Generator().manual_seed(recipe.seed * 7_368_787 + epoch)
    return iter(torch.randperm(count, generator=generator).split(recipe.batch_size))


def _is_eigenvalue(name: str) -> bool:
    return name.rpartition(".")[2] in ("nu_log", "theta_log")


def _clone(model: torch.nn.Module) -> dict[str, Any]:
    return {name: t.detach().clone() for name, t in model.state_dict().items()}
