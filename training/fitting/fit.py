"""Fitting a model to a data set: the loop, its schedules, its checkpoints.

Every random choice is a function of (seed, iteration), and every schedule of the iteration alone. A run
continued from a checkpoint is the run that was never interrupted, bit for bit (same machine, same threads).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, cast

import torch
from torch import Tensor
from torch.nn import BatchNorm1d
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from engine.compare.relative import ErrorSums, RelativeError
from engine.models.base import StringModel
from engine.plain_text import one_line
from engine.schema import SchemaError, read, write
from training.configuration import Recipe, Run, TrainingConfiguration, read_configuration
from training.data.batches import Batch, TrainingData, batches, keeps_every_frame
from training.data.dataset import Dataset
from training.evaluate import evaluate_model
from training.fitting import together
from training.fitting.checkpoint import Checkpoint
from training.fitting.losses import backward
from training.fitting.recorded import RecordedWork
from training.fitting.soap import SOAP
from training.fitting.start import begin
from training.start import LEAST_SQUARES

CHECKPOINT_EVERY_S = 30.0  # at most between two; longer where one step takes longer
TELL_EVERY_S = 5.0  # between two reports of progress within an epoch


class Diverged(RuntimeError):
    """The loss is no longer finite, or no validation error was ever a number."""


@dataclass(frozen=True)
class FitProgress:
    """The progress of a run, reported at the end of every epoch, and within long ones.

    Attributes:
        step, steps: optimiser's steps, done and in all.
        epoch: the one that ends, or is under way, from 1 to `epochs`.
        horizon: frames in reach of the loss.
        loss: mean square of the predictions' errors so far in this epoch, in normalised units.
        validation: None where it was not measured now.
        seconds, seconds_left: of training, so far and estimated.
    """

    step: int
    steps: int
    epoch: int
    epochs: int
    horizon: int
    learning_rate: float
    loss: float
    validation: RelativeError | None
    seconds: float
    seconds_left: float

    @property
    def ends_epoch(self) -> bool:
        return self.step * self.epochs == self.epoch * self.steps


@dataclass(frozen=True)
class FitResult:
    """The model of the best validation MAE, and what it took.

    Attributes:
        best_epoch: 0 where training did not beat the start.
        validation: the error sums of the model.
        seconds: of all of it, what it starts from and the measuring among it.
        start: validation error of the untrained model; None where there is none: a fit in one go, a start whose
            latents are still to be learned, or a model that runs away.
    """

    model: StringModel[Any]
    validation: ErrorSums
    epochs: int
    best_epoch: int
    seconds: float
    start: RelativeError | None = None


Report = Callable[[Run, FitProgress], None]


def fit_seeds(
    runs: Sequence[Run],
    dataset: Dataset,
    folder: Path,
    *,
    report: Report = lambda run, progress: None,
    device: torch.device | str = "cpu",
    checkpoint_every_s: float | None = None,
) -> list[FitResult | Diverged]:
    """Train or continue runs that differ in their seeds alone, step by step together; a DMD is computed at once.

    On a GPU, runs at the same step take one pass (`fitting.together`). Those behind, as after a kill between two
    checkpoints, catch up first. A run that diverges leaves the others.

    Args:
        folder: of the runs' folders, in which each has its checkpoint and continues from it.
        report: called after every epoch, and every few seconds within.

    Returns:
        The outcome of each. Seconds are the shares of the time that all took.

    Raises:
        ValueError: a checkpoint is damaged or of another configuration, or the runs differ in more than their seeds.
    """
    first = runs[0].configuration
    for other in (run.configuration for run in runs):
        same_recipe = replace(other.recipe, seed=first.recipe.seed) == first.recipe
        if not same_recipe or (other.model, other.data, other.steps) != (first.model, first.data, first.steps):
            raise ValueError("runs that are trained together must differ in their seeds alone")
    if first.start == LEAST_SQUARES:
        return [_fit_at_once(run, dataset, report) for run in runs]
    every_s = CHECKPOINT_EVERY_S if checkpoint_every_s is None else checkpoint_every_s
    under_way = [_UnderWay(run, dataset, torch.device(device), folder, report) for run in runs]
    steps = Steps()
    started = before = time.monotonic()
    iterations = 0
    while left := [run for run in under_way if not run.ended]:
        step = min(run.step for run in left)
        group = [run for run in left if run.step == step]
        steps.take(group)
        now, iterations = time.monotonic(), iterations + 1
        for run in group:
            run.seconds += (now - before) / len(group)
            run.follow_step((now - started) / iterations, every_s)
        before = now
    return [run.outcome() for run in under_way]


def learning_rate_at(recipe: Recipe, share: float) -> float:
    """The learning rate: constant, or one cycle of a linear warm-up to the peak, then a cosine to zero.

    `share`: of the run, 0 … 1.
    """
    if recipe.schedule == "constant":
        return recipe.peak_learning_rate
    if share < recipe.warm_up:
        rise = share / recipe.warm_up
        return recipe.peak_learning_rate * (recipe.start_share + (1 - recipe.start_share) * rise)
    return recipe.peak_learning_rate * 0.5 * (1 + math.cos(math.pi * (share - recipe.warm_up) / (1 - recipe.warm_up)))


def horizon_at(recipe: Recipe, share: float, steps: int) -> int:
    """Frames in reach of the loss: geometric growth from the first horizon to `steps`."""
    first = min(recipe.first_horizon, steps)
    if share >= recipe.grow_until:
        return steps
    return round(first * (steps / first) ** (share / recipe.grow_until))


class Steps:
    """The steps of runs that are at the same one: in one pass where their model allows it, recorded on a GPU."""

    def __init__(self) -> None:
        self._runs: Sequence[TrainingState] = []  # that took the last step
        self._work: Callable[[], None] = lambda: None  # a step of these runs

    def take(self, runs: Sequence[TrainingState]) -> None:
        """Take the next step of `runs`; a change of runs makes the work again."""
        if runs != self._runs:
            self._runs = runs
            work = partial(take_step, runs)
            recorded = runs[0].device.type == "cuda" and all(run.repeats_itself for run in runs)
            self._work = RecordedWork(work) if recorded else work
        for run in runs:
            run.begin_step()
        self._work()
        for run in runs:
            run.end_step()


def take_step(runs: Sequence[TrainingState]) -> None:
    """Move the weights of runs by the step that was begun: all of it that a GPU does."""
    if any(run.learns_latents for run in runs):
        for run in runs:
            run.learn_latents()
        return
    models, batches = [run.model for run in runs], [run.draw() for run in runs]
    if len(runs) > 1 and together.can_be_mapped(models, batches):
        errors: Iterable[Tensor] = together.backward(models, batches, runs[0].recipe)
    else:
        errors = (run.backward(batch) for run, batch in zip(runs, batches, strict=True))
    for run, error in zip(runs, errors, strict=True):
        run.descend(error)


class TrainingState:
    """A training between two steps: all that a checkpoint holds.

    Latents are what an encoder yields. After a matching pursuit the encoder first learns the latents that were fitted
    to the data; only then are there predictions to train on.

    Attributes:
        step: of the optimiser, how many are done.
        seconds: of training, over all processes that took part.
    """

    def __init__(self, configuration: TrainingConfiguration, dataset: Dataset, device: torch.device) -> None:
        recipe = configuration.recipe
        self._configuration = configuration
        self.recipe = recipe
        self._dataset = dataset
        self.device = device
        self.model, latents = begin(configuration, dataset)
        self._latents = latents.to(device) if latents else None  # to be learned first; None: none are
        self.model.to(device)
        self._data = TrainingData(dataset, device)
        self._per_epoch = -(-self._data.count // recipe.batch_size)  # steps
        self._optimiser = _optimiser(self.model, recipe)
        self._rows = torch.zeros(0, dtype=torch.int64, device=device)  # trajectories of the step that was begun
        self._average: AveragedModel | None = None  # running mean of the weights; None: the recipe has none
        if recipe.average_decay:
            mean = get_ema_multi_avg_fn(recipe.average_decay)
            self._average = AveragedModel(self.model, multi_avg_fn=mean, use_buffers=True)
        self.step, self.seconds = 0, 0.0
        self._total = torch.zeros((), device=device)  # sum of this epoch's mean squares, one a step
        self._start: RelativeError | None = None  # validation error before training, see `FitResult.start`
        self._best: RelativeError | None = None  # lowest validation error by MAE; None: none was finite
        self._best_sums: ErrorSums | None = None  # None where they were measured before the last checkpoint
        self._best_epoch = 0
        self._best_model = _copy(self.model)

    @property
    def epoch(self) -> int:
        """The one that has just ended, or is under way."""
        return -(-self.step // self._per_epoch)

    @property
    def ends_epoch(self) -> bool:
        """Return True between two epochs, also before the first step."""
        return self.step % self._per_epoch == 0

    @property
    def ended(self) -> bool:
        """Return True if no step is left: after the last epoch, or where patience has run out."""
        # while the latents are learned there is no prediction, and so none that is no better
        since = max(self._best_epoch, self._latent_steps // self._per_epoch)
        gave_up = 0 < self.recipe.patience <= self.epoch - since
        return self.ends_epoch and (self.epoch >= self.recipe.epochs or gave_up)

    @property
    def _latent_steps(self) -> int:
        """The number of steps in which the encoder learns the fitted latents; until then there is no prediction."""
        return min(self.recipe.latent_epochs, self.recipe.epochs) * self._per_epoch

    @property
    def validation_is_due(self) -> bool:
        """Return True if the epoch that has just ended is one that is validated."""
        if self.step <= self._latent_steps:
            return self.step == self._latent_steps
        return self.epoch % self.recipe.validate_every == 0 or self.epoch == self.recipe.epochs

    @property
    def loss(self) -> float:
        """Mean square of the predictions' errors, so far in this epoch."""
        return float(self._total) / ((self.step - 1) % self._per_epoch + 1)

    @property
    def learns_latents(self) -> bool:
        """Return True if the next step teaches the encoder the fitted latents."""
        return self._latents is not None and self.step < self._latent_steps

    @property
    def repeats_itself(self) -> bool:
        """Return True if every step is the same work on other trajectories."""
        recipe, steps = self.recipe, self._configuration.steps
        same_frames = recipe.first_horizon >= steps and keeps_every_frame(recipe, steps)
        same_sizes = self._data.count % recipe.batch_size == 0
        same_layers = recipe.batch_statistics_until == 1 and recipe.optimiser == "adamw"
        more_work = recipe.flip or recipe.latent_epochs or recipe.average_decay
        return same_frames and same_sizes and same_layers and not more_work

    def begin_step(self) -> None:
        """Set the next step's rates and trajectories, where a recorded step reads them."""
        recipe, model = self.recipe, self.model
        epoch, number = divmod(self.step, self._per_epoch)
        if number == 0:
            self._lay_out(epoch)
            self._total.zero_()
        rows = self._batches[number]
        self._rows = self._rows.copy_(rows) if self._rows.shape == rows.shape else rows.clone()
        _, learning_rate = self._schedules()
        for group in self._optimiser.param_groups:
            rate = learning_rate * group["share"]
            group["lr"] = group["lr"].fill_(rate) if isinstance(group["lr"], Tensor) else rate
        model.train()
        if self.step >= recipe.batch_statistics_until * recipe.epochs * self._per_epoch:
            _keep_statistics(model)

    def _lay_out(self, epoch: int) -> None:
        """Draw the batches of an epoch, which go to the device at once."""
        drawn = torch.cat(batches(self.recipe, self._data.count, epoch))
        self._batches = drawn.to(self.device).split(self.recipe.batch_size)

    def learn_latents(self) -> None:
        """Move the encoder towards the fitted latents."""
        assert self._latents is not None
        if self.step >= self._latent_steps - self.recipe.latent_polish:
            self._total += self._latents.polish(self.model, self.recipe)
        else:
            loss, error = self._latents.loss(self.model, self.recipe, self._rows, self.step)
            self._optimiser.zero_grad(set_to_none=True)
            loss.backward()
            self.descend(error)

    def draw(self) -> Batch:
        """The batch of the step that was begun, over the present horizon."""
        horizon, _ = self._schedules()
        return self._data.draw(self.recipe, self._rows, horizon, self.step)

    def backward(self, batch: Batch) -> Tensor:
        """Set the weights' gradients, and return the mean square of the prediction's error."""
        self._optimiser.zero_grad(set_to_none=True)
        return backward(self.model, batch, self.recipe)

    def descend(self, error: Tensor) -> None:
        """A step of the optimiser against the gradients that the weights have; `error` is reported."""
        *faster, slow = (group["params"] for group in self._optimiser.param_groups)
        bounded = [*chain.from_iterable(faster), *(slow if self.recipe.clip_eigenvalues else ())]
        torch.nn.utils.clip_grad_norm_(bounded, self.recipe.clip_norm)
        self._optimiser.step()
        self._total += error

    def end_step(self) -> None:
        """Count the step that was taken."""
        self.step += 1
        if self._latents is not None and self.step == self._latent_steps:
            self._latents.yield_latents(self.model)
            self._optimiser = _optimiser(self.model, self.recipe)
        if self._average is not None and self.step >= self._latent_steps:
            self._average.update_parameters(self.model)

    def _schedules(self) -> tuple[int, float]:
        """Horizon and learning rate of the next step."""
        recipe, latent_steps = self.recipe, self._latent_steps
        if self.step < latent_steps:
            peak = recipe.latent_learning_rate / recipe.peak_learning_rate
            return self._configuration.steps, peak * learning_rate_at(recipe, self.step / latent_steps)
        share = (self.step - latent_steps) / max(1, recipe.epochs * self._per_epoch - latent_steps)
        return horizon_at(recipe, share, self._configuration.steps), learning_rate_at(recipe, share)

    def progress(self, validation: RelativeError | None, step_s: float) -> FitProgress:
        """The progress; `validation`: None where it was not measured now, `step_s`: mean time of a step so far."""
        epochs, (horizon, learning_rate) = self.recipe.epochs, self._schedules()
        steps = epochs * self._per_epoch
        left_s = step_s * (steps - self.step)
        at = (self.step, steps, self.epoch, epochs, horizon, learning_rate)
        return FitProgress(*at, self.loss, validation, self.seconds, left_s)

    def validate(self) -> RelativeError:
        """The validation error; the best model so far is kept."""
        model = self._measured()
        sums = evaluate_model(model, self._dataset, "validation", self._configuration.steps)
        error = sums.total()
        if _is_finite(error) and (self._best is None or error.rel_mae < self._best.rel_mae):
            self._best, self._best_sums = error, sums
            self._best_epoch, self._best_model = self.epoch, _copy(model)
        return error

    def measure_start(self) -> None:
        """The error before the first step, which training must beat."""
        if not self._latent_steps:
            error = self.validate()
            self._start = error if _is_finite(error) else None

    def result(self) -> FitResult:
        """Return the best model by validation MAE with its errors. Raises Diverged: there is none."""
        if self._best is None:
            raise Diverged("the validation error was never a number; lower peak_learning_rate")
        model = self._measured()
        model.load_state_dict(self._best_model)
        sums = self._best_sums or evaluate_model(model, self._dataset, "validation", self._configuration.steps)
        return FitResult(model.eval(), sums, self.epoch, self._best_epoch, self.seconds, self._start)

    def checkpoint(self) -> Checkpoint:
        """Return all that `restore` needs to continue bit for bit."""
        facts = {
            "configuration": write(self._configuration),
            "step": self.step,
            "loss_total": float(self._total),
            "seconds": self.seconds,
            "start": write(self._start) if self._start else None,
            "best": write(self._best) if self._best else None,
            "best_epoch": self._best_epoch,
        }
        average = self._average.state_dict() if self._average is not None else {}
        moments = {str(index): of_one for index, of_one in self._optimiser.state_dict()["state"].items()}
        return Checkpoint(self.model.state_dict(), self._best_model, average, moments, facts)

    def restore(self, checkpoint: Checkpoint, path: Path) -> None:
        """Set all of the state to a checkpoint's; `path`: its file, for messages.

        Raises:
            ValueError: it is damaged, or of other settings; the message names the remedy.
        """
        facts, device = checkpoint.facts, next(self.model.parameters()).device
        try:  # read, not compared as it is: fields that came later have their defaults
            other = read_configuration(facts["configuration"], f"{path}: configuration")
            self.step, self.seconds = int(facts["step"]), float(facts["seconds"])
            self._total.fill_(facts["loss_total"])
            self._best_epoch = int(facts["best_epoch"])
            self._best = read(RelativeError, facts["best"], f"{path}: best") if facts["best"] else None
            start = facts.get("start")
            self._start = read(RelativeError, start, f"{path}: start") if start else None
        except (SchemaError, KeyError, TypeError) as error:
            raise ValueError(f"{path}: of another version ({error}); delete it to start the run again") from error
        except (ValueError, OverflowError, RuntimeError) as error:
            raise ValueError(f"{path}: damaged checkpoint ({error}); delete it to start the run again") from error
        if other.digest != self._configuration.digest:
            raise ValueError(
                f"{path}: was trained with other settings; delete it to start again, or give another --runs"
            )
        try:
            self.model.load_state_dict(dict(checkpoint.model))
            if self._average is not None:
                self._average.load_state_dict(dict(checkpoint.average))
            moments = {int(index): dict(of_one) for index, of_one in checkpoint.optimiser.items()}
            self._optimiser.load_state_dict({**self._optimiser.state_dict(), "state": moments})
        except (RuntimeError, ValueError, KeyError, TypeError) as error:  # torch's words for tensors that do not fit
            message = one_line(f"{path}: damaged checkpoint ({error}); delete it to start the run again")
            raise ValueError(message) from error
        self._best_model = {name: t.to(device) for name, t in checkpoint.best_model.items()}
        self._lay_out(self.step // self._per_epoch)

    def _measured(self) -> StringModel[Any]:
        """The model that the run is judged by: the running mean of its weights, where it keeps one."""
        return self.model if self._average is None else cast("StringModel[Any]", self._average.module)


class _UnderWay(TrainingState):
    """A run of several, with its checkpoint's file and what was last saved and reported."""

    def __init__(self, run: Run, dataset: Dataset, device: torch.device, folder: Path, report: Report) -> None:
        begun = time.monotonic()
        super().__init__(run.configuration, dataset, device)
        self._path, self._report = folder / run.name / "checkpoint.safetensors", partial(report, run)
        self._diverged: Diverged | None = None  # None: it has not
        if self._path.exists():
            self.restore(Checkpoint.load(self._path), self._path)
        else:
            self.measure_start()
            self.seconds = time.monotonic() - begun
        self._saved = self._reported = time.monotonic()  # when it was last, in s of that clock

    @property
    def ended(self) -> bool:
        return self._diverged is not None or super().ended

    def outcome(self) -> FitResult | Diverged:
        """Return the result of a run that has ended, or why it has none."""
        try:
            return self._diverged or self.result()
        except Diverged as error:
            return error

    def follow_step(self, step_s: float, every_s: float) -> None:
        """Validate, report and save what is due after a step.

        Args:
            step_s: mean time of a step so far.
            every_s: between two checkpoints, at most.
        """
        validation = None
        if self.ends_epoch:
            if not math.isfinite(self.loss):
                self._diverged = Diverged(f"the loss is {self.loss} in epoch {self.epoch}; lower peak_learning_rate")
                return
            validation = self.validate() if self.validation_is_due else None
        now = time.monotonic()
        if self.ends_epoch or now - self._reported > TELL_EVERY_S:
            self._report(self.progress(validation, step_s))
            self._reported = now
        if now - self._saved + step_s > every_s or self.ended:
            self.checkpoint().save(self._path)
            self._saved = now


def _fit_at_once(run: Run, dataset: Dataset, report: Report) -> FitResult:
    """Fit a model whose start is all there is."""
    started, steps = time.monotonic(), run.configuration.steps
    model, _ = begin(run.configuration, dataset)
    sums = evaluate_model(model, dataset, "validation", steps)
    error = sums.total()
    if not _is_finite(error):
        raise Diverged("the fit grows beyond all numbers on the validation set; choose a lower rank")
    seconds = time.monotonic() - started
    truth = dataset.split("train")[:100, : steps + 1] @ dataset.synthesis.float()
    with torch.no_grad():
        loss = float((model(truth[:, 0], steps) - truth[:, 1:]).square().mean())
    report(run, FitProgress(1, 1, 1, 1, steps, 0.0, loss, error, seconds, 0.0))
    return FitResult(model.eval(), sums, 1, 1, seconds)


def _optimiser(model: StringModel[Any], recipe: Recipe) -> torch.optim.Optimizer:
    """The optimiser of a recipe, with three groups of parameters.

    They are all others, the couplings, and last the slow ones, as a rule the eigenvalues'. A group's `share` is that
    of the learning rate which it gets.
    """
    eigenvalues: list[torch.nn.Parameter] = []
    coupling: list[torch.nn.Parameter] = []
    others: list[torch.nn.Parameter] = []
    for name, parameter in model.named_parameters():
        last = name.rpartition(".")[2]
        slow = recipe.slow_parameters or model.eigenvalue_parameters
        declared = (slow, eigenvalues), (model.coupling_parameters, coupling)
        next((group for names, group in declared if last in names), others).append(parameter)
    groups = [
        {"params": others, "share": 1.0},
        {"params": coupling, "share": recipe.coupling_rate},
        {
            "params": eigenvalues,
            "share": recipe.eigenvalue_rate,
            "weight_decay": recipe.weight_decay if recipe.eigenvalue_decay else 0.0,
        },
    ]
    device = next(model.parameters()).device
    if recipe.optimiser == "soap":
        return SOAP(groups, lr=recipe.peak_learning_rate, weight_decay=recipe.weight_decay)
    if device.type == "cpu":
        return torch.optim.AdamW(groups, lr=recipe.peak_learning_rate, weight_decay=recipe.weight_decay)
    for group in groups:  # tensors that a recorded step reads
        group["lr"] = torch.tensor(recipe.peak_learning_rate, device=device)
    return torch.optim.AdamW(groups, weight_decay=recipe.weight_decay, fused=True, capturable=True)


def _keep_statistics(model: torch.nn.Module) -> None:
    """Let batch norm divide by its stored statistics, and leave them as they are.

    A batch of loud strings then differs from one of soft ones.
    """
    for module in model.modules():
        if isinstance(module, BatchNorm1d):
            module.eval()


def _is_finite(error: RelativeError) -> bool:
    return math.isfinite(error.rel_mse) and math.isfinite(error.rel_mae)


def _copy(model: torch.nn.Module) -> dict[str, Any]:
    """A copy of a model's weights by name."""
    return {name: deepcopy(t.detach()) for name, t in model.state_dict().items()}
