"""Training of a baseline on the family's strings: gradient steps on random frames for a budget of processor time.

The loss is `fit_curves`' own, the mean logarithm of each string's relative error, over a growing part of the first
second; the strings are those of the same configuration and split. A stopped run continues from its checkpoint.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from engine.plain_text import one_line
from tests.bench.baselines.models import BASELINES, LONGEST_S, Baseline, Strings, in_own_units, units
from training.family.fit import FLOOR
from training.family.motions import solve
from training.family.preset import FamilyConfiguration
from training.family.strings import MOST_MODES, draw_string
from training.fitting.checkpoint import Checkpoint, optimiser_moments, restore_moments

ROWS, FRAMES = 16, 48  # of a batch
FRAMES_KEPT = 1_500_000  # of all strings together, at random times
FRAMES_VALIDATED = 384  # of each string
FIRST_S = 0.002  # in reach of the loss; it grows to all within the first half
PEAK_LEARNING_RATE, WARM_UP = 1e-3, 0.02
SAVE_EVERY_S = 30.0  # of processor time


@dataclass(frozen=True)
class BaselineProgress:
    """Share of the budget; steps; geometric means of the errors since the last, and the best in validation; time."""

    share: float
    steps: int
    train: float
    validation: float
    left_s: float


@dataclass(frozen=True)
class TrainedBaseline:
    """The best model in validation, after so many steps; geometric means of the errors.

    Attributes:
        train: of the last batches.
        validation: of the model.
    """

    model: Baseline
    steps: int
    train: float
    validation: float


@dataclass(frozen=True)
class _Motions:
    """True motions at some times, float64 (rows, times), ascending; amplitudes (rows, times, MOST_MODES)."""

    strings: Strings
    times: Tensor
    amplitudes: Tensor


def checkpoint_file(runs: Path, name: str) -> Path:
    return runs / f"family_{name}" / "checkpoint.safetensors"


def trained_baseline(path: Path) -> TrainedBaseline:
    """The result of a run. Raises ValueError, naming file and remedy, where its checkpoint is damaged."""
    checkpoint = Checkpoint.load(path)
    with _naming(path):
        model = BASELINES[checkpoint.facts["baseline"]]()
        model.load_state_dict(dict(checkpoint.best_model))
        facts = checkpoint.facts
        return TrainedBaseline(model.eval(), int(facts["steps"]), float(facts["train"]), float(facts["best"]))


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """What a checkpoint lacks is reported with its file and the remedy."""
    try:
        yield
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        reported = one_line(repr(error), 200)
        raise ValueError(
            f"{path}: no checkpoint of a baseline ({reported}); delete it to start the run again"
        ) from error


def fit_baseline(
    name: str,
    configuration: FamilyConfiguration,
    path: Path,
    minutes: float,
    *,
    strings: int | None = None,
    made: Callable[[float], None] = lambda share: None,
    report: Callable[[BaselineProgress], None] = lambda progress: None,
) -> TrainedBaseline:
    """Train, or continue with the run whose checkpoint is at `path`; the best model on the validation strings.

    Args:
        minutes: of processor time of one thread, the making of the motions not counted.
        strings: of the training split; None: the configuration's.

    Raises:
        ValueError: the checkpoint is damaged, or of another run.
    """
    c = configuration
    counts = {"train": strings or c.strings, "validation": c.validation_strings}
    facts = {"baseline": name, "minutes": minutes, "strings": counts["train"], "seed": c.seed}
    torch.manual_seed(c.seed)
    model = BASELINES[name]()
    optimiser = torch.optim.AdamW(model.parameters(), lr=PEAK_LEARNING_RATE, weight_decay=1e-4)
    best, best_model, train_error, steps, spent_s = math.inf, _weights(model), math.inf, 0, 0.0
    if path.exists():
        checkpoint = Checkpoint.load(path)
        if {key: checkpoint.facts.get(key) for key in facts} != facts:
            raise ValueError(f"{path}: of another run; give its options again, or delete it")
        with _naming(path):
            model.load_state_dict(dict(checkpoint.best_model))
            best_model = _weights(model)
            model.load_state_dict(dict(checkpoint.model))
            restore_moments(optimiser, checkpoint.optimiser)
            best, train_error, spent_s = (float(checkpoint.facts[name]) for name in ("best", "train", "spent_s"))
            steps = int(checkpoint.facts["steps"])
    if spent_s < 60 * minutes:
        train = _motions("train", counts["train"], FRAMES_KEPT // counts["train"], c, lambda s: made(0.8 * s))
        validation = _motions("validation", counts["validation"], FRAMES_VALIDATED, c, lambda s: made(0.8 + 0.2 * s))
    started, saved_s, total, counted = time.process_time() - spent_s, spent_s, 0.0, 0
    begun, begun_share = time.monotonic(), spent_s / (60 * minutes)
    while spent_s < 60 * minutes:
        share = spent_s / (60 * minutes)
        for group in optimiser.param_groups:
            group["lr"] = _learning_rate(share)
        generator = torch.Generator().manual_seed((c.seed + 1) * 1_000_003 + steps)
        loss = _error(model, *_draw(train, share, generator)).log().mean()
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimiser.step()
        steps, total, counted = steps + 1, total + float(loss.detach()), counted + 1
        spent_s = time.process_time() - started
        if spent_s - saved_s > SAVE_EVERY_S or spent_s >= 60 * minutes:
            found = _validate(model, validation)
            if found < best:
                best, best_model = found, _weights(model)
            spent_s = saved_s = time.process_time() - started
            train_error = math.exp(total / counted)
            reported = facts | {"best": best, "train": train_error, "steps": steps, "spent_s": spent_s}
            Checkpoint(_weights(model), best_model, {}, optimiser_moments(optimiser), reported).save(path)
            share = min(1.0, spent_s / (60 * minutes))
            left_s = (time.monotonic() - begun) * (1 - share) / max(share - begun_share, 1e-6)
            report(BaselineProgress(share, steps, train_error, best, left_s))
            total, counted = 0.0, 0
    model.load_state_dict(best_model)
    return TrainedBaseline(model.eval(), steps, train_error, best)


def _motions(
    split: str, count: int, frames: int, configuration: FamilyConfiguration, made: Callable[[float], None]
) -> _Motions:
    rate_hz, steps = configuration.rate_hz, round(LONGEST_S * configuration.rate_hz)
    frames = min(frames, steps)
    generator = torch.Generator().manual_seed(configuration.seed)
    times, drawn = [], []
    amplitudes = torch.zeros(count, frames, MOST_MODES)
    for number in range(count):
        plucked = draw_string("inside", split, number, configuration.seed)
        frequency, amplitude_m = units(plucked.string)
        kept = torch.randperm(steps, generator=generator)[:frames].sort().values
        motion = solve(plucked, rate_hz, steps)[kept] / amplitude_m
        amplitudes[number, :, : motion.shape[1]] = motion.float()
        times.append((kept + 1).double() * (frequency / rate_hz))
        drawn.append(plucked)
        made((number + 1) / count)
    return _Motions(in_own_units(drawn), torch.stack(times), amplitudes)


def _draw(motions: _Motions, share: float, generator: torch.Generator) -> tuple[Strings, Tensor, Tensor]:
    """A batch: strings, times, and the truth there."""
    count, frames = motions.times.shape
    reach = FIRST_S * (LONGEST_S / FIRST_S) ** min(1.0, 2 * share)
    rows = torch.randint(count, (ROWS,), generator=generator)
    most = max(FRAMES, round(frames * reach / LONGEST_S))
    frame = torch.randint(min(most, frames), (ROWS, FRAMES), generator=generator)
    return motions.strings.rows(rows), motions.times[rows[:, None], frame], motions.amplitudes[rows[:, None], frame]


def _error(model: Baseline, strings: Strings, times: Tensor, truth: Tensor) -> Tensor:
    """Relative squared error of each string, (rows,)."""
    wrong = (model(strings, times) - truth).square().sum((1, 2))
    return wrong / truth.square().sum((1, 2)).clamp(min=1e-30) + FLOOR


@torch.no_grad()
def _validate(model: Baseline, motions: _Motions) -> float:
    """Geometric mean over the strings."""
    logs = [
        _error(model, motions.strings.rows(rows), motions.times[rows], motions.amplitudes[rows]).log()
        for rows in torch.arange(len(motions.times)).split(4)
    ]
    return float(torch.cat(logs).mean().exp())


def _learning_rate(share: float) -> float:
    if share < WARM_UP:
        return PEAK_LEARNING_RATE * share / WARM_UP
    return PEAK_LEARNING_RATE * 0.5 * (1 + math.cos(math.pi * (share - WARM_UP) / (1 - WARM_UP)))


def _weights(model: Baseline) -> dict[str, Tensor]:
    return {name: value.detach().clone() for name, value in model.state_dict().items()}
